"""How derivatives depend on the propellers' advance ratio: local estimates become laws, cluster by cluster.

Read local (what the laws are made from), clusters, law; flights are fitted elsewhere.
"""

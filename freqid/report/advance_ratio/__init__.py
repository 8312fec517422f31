"""The page of laws against advance ratio: derivatives by cluster, evidence of the forms, held-out manoeuvres.

Read page, then figures and tables.
"""

"""The report on several results: the decision on page one, then a part for each, in the order of a campaign.

Read page (what stands where), decision, points (tables of parameters, truth), vehicle, methods.
"""

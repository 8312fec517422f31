"""The page of a Monte Carlo campaign: coverage, bias, detections and false alarms against the chosen axis.

Read page.
"""

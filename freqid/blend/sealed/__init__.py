"""Predictions that are sealed before a flight, and the flight held against them; their files are in core.

Read condition, bands, assumptions, score.
"""

"""Predictions that are sealed before a flight, and the flight held against them; scripts and files are elsewhere.

Read condition, bands, assumptions, score.
"""

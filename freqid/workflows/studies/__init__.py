"""Whole campaigns: simulated, flown, or all trims in one flight, from conditions to what a page shows.

`study` is the door; `units` runs what is done once a condition, `studied` says what both kinds share.
"""

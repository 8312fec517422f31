"""Whole studies: along the corridor, simulated or flown, or over advance ratios in one long flight.

`study` is the door, `study_by_advance_ratio` the one long flight; `units` runs what is done once a condition,
`studied` says what simulated and flown studies share.
"""

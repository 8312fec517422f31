"""Estimates while the manoeuvre is still flown, sample by sample; the batch estimates are in point.

Read recursive_transform, recursive, running, parameter_history.
"""

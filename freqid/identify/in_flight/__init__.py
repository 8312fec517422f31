"""Estimates while the manoeuvre is still flown, sample by sample; those of a whole record are in point.

Read recursive, running, parameter_history, convergence.
"""

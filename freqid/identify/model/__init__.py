"""The regressions of a point model: which responses on which regressors, on lines or samples.

How a regression is solved is in regress, the whole job in point.

Read problem, line_equations, fit, selection.
"""

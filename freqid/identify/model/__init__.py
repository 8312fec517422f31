"""The regressions of a point model: which responses on which regressors, on lines or samples.

Read problem, line_equations, fit_lines, fit_samples, selection.
"""

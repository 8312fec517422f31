"""Linear regression on named columns: estimates, covariances, which columns to keep; it knows no aircraft.

Read equations, regression, confidence_interval, estimators, two_stage, covariance_corrections, noise_lines,
structure, orthogonal.
"""

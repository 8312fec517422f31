"""Linear regression on named columns: estimates, covariances, which columns to keep; it knows no aircraft.

Read equations, regression, two_stage, estimators, covariance_corrections, noise_lines, structure, orthogonal.
"""

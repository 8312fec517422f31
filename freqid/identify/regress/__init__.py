"""Linear regression on named columns: estimates, covariances, and which columns to keep; no aircraft.

Read regression, two_stage, estimators, uncertainty, noise_lines, then structure and what it serves.
"""

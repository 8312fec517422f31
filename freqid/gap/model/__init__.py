"""What may change the stack: tolerances, effects at finite size, unknowns of each record, errors of form.

Every column is computed on motion without noise. Nothing here looks at the residual.
"""

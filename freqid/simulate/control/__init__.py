"""Trim, linearisation and the control law that holds the vehicle while it is excited.

Read trim, linearize, lq, law.
"""

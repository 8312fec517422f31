"""Trim, linearisation and the control law that holds the vehicle while it is excited.

The law of a flown record is fitted in identify/instruments.

Read trim, linearize, lq, law.
"""

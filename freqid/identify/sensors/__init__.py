"""Sensor errors and delays: found, and taken out of a record; a point model's own uncertainty is in regress.

Read kinematics and its parts (biases and scale factors), then delays and its parts.
"""

"""Sensor errors and delays: found, and taken out of a record before anything is made of it.

The loads are modelled here only as far as a delay has to be told apart from them.

Read errors (how a channel reads); flight_path, kinematic_model, kinematic_fit and kinematics (biases, scale
factors, delays and wind, in time); then alignment_motion, alignment_loads and alignment (delays by group, on
lines).
"""

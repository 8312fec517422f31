"""Orthogonal multisines: harmonics, phases, powers and what the set adds up to; no model of the aircraft.

Read orthogonal_set, signals, allocation, phases, net_load, merit.
"""

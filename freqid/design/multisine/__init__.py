"""Orthogonal multisines: harmonics, phases, powers and what the set adds up to; no model of the aircraft.

Read signals, orthogonal_set, allocation, phases, net_load, joint_phases, merit.
"""

"""Measured less simulated, on lines of frequency: the rows, their noise, and the motion without noise.

Read `rows` (what is compared), `lines` (where), `motion` (the flight without noise), `noise`, then `block`,
which puts them together for one condition. Nothing here knows of effects or tolerances.
"""

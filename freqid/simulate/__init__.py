"""A flight in place of the aircraft; only the simulation knows the truth, and no estimate is made here.

Read maneuver and fly, then motion, loads, control, air, effects (one a file), sensors and truth.
"""

"""A flight in place of the aircraft; only the simulation knows the truth."""

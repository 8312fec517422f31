"""A flight in place of the aircraft; only the simulation knows the truth, and no estimate is made here.

As a verb, ``freqid.simulate(scenario, ...)``, it is `freqid.workflows.fly.simulate`: its help is there.
Read maneuver and fly, then motion, loads, control, air, effects (one a file), sensors and truth.
"""

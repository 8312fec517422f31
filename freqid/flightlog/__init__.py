"""Logs of other tools, read into a FlightRecord and written back.

Read `read` (the door) and `readers`, then the way of a signal: `column_map`, `mapped`, `derive`, `spikes`,
`resample`, `assemble`; `plausibility` checks the record, `listing` proposes a map, `cut` finds manoeuvres.
"""

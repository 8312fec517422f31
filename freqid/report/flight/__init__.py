"""The page of a simulated flight, with the aircraft drawn; the flight is made in simulate.

Read page, tables, figures, trims, aircraft.
"""

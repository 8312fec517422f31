"""From a manoeuvre to a point model; sees only what an aircraft would log, never the simulation's truth.

Read point (the whole job), then spectra, loads, regress, model, instruments from the ground up; sensors,
in_flight and response are jobs of their own.
"""

"""Logs of other tools, read into a FlightRecord and written back."""

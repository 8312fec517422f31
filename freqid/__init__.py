"""Frequency-domain system identification of eVTOL aircraft from flight data."""

__version__ = "0.1.0"

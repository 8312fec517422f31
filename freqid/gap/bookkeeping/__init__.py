"""Mistakes that are made when a simulation is first laid beside a flight, found before any physics."""

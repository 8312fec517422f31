"""Sections of a scenario with a file of their own: what is excited, how it is identified, one long flight."""

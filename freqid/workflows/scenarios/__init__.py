"""A scenario begun, and checked for what it lacks."""

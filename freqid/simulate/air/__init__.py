"""The air that the vehicle flies in: density, wind and gusts. What it does to the vehicle is in loads.

Read surroundings, atmosphere, dryden.
"""

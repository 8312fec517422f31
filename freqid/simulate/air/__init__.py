"""The air that the vehicle flies in: density, wind and gusts.

Read surroundings, atmosphere, dryden.
"""

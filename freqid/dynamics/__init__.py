"""The physics that several storeys share, written once in numpy; no flight data, no simulation.

Read small_motion.
"""

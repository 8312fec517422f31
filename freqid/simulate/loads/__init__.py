"""Forces and moments of each part of the airframe, without memory; what moves is in motion.

Read quantities, airframe, then part by part; sections and description make parameters from a scenario.
"""

"""The physics that several storeys share, written once in numpy; it reads no flight data and makes no design.

Read frames (axes and points), mass (tilting wings), moment_reference_point (moments about another point),
small_motion (equations of motion), loop (a law with integral action, line by line), then linear_loop (margins
of a vehicle with its actuators) and modes.
"""

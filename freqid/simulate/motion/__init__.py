"""The vehicle in motion: rigid bodies, actuators, battery, integration; which forces act is in loads.

Read whole_vehicle (where a delay enters: delay), rigid_body, multibody, actuators, integrate, derivatives.
"""

"""The vehicle in motion: rigid bodies, actuators, battery, integration; which forces act is in loads.

Read whole_vehicle, rigid_body, multibody, actuators, integrate, derivatives. A command arrives late by
effects/actuator_delay; delay_line holds it until then.
"""

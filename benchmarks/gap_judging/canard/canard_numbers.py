"""Numbers of the canard that the truth and its owner share."""

from scatter import of_actuators

AREA, CHORD, SPAN = 0.936, 0.367, 2.6  # of the wing alone
# Lifting surfaces, right half: root and tip quarter-chord point, chords, m; panels from root to tip.
WING = ((-0.03, 0.0, 0.0), (-0.555, 1.30, -0.045), 0.46, 0.26, 4)
CANARD = ((0.95, 0.0, 0.05), (0.93, 0.55, 0.05), 0.19, 0.19, 2)
WINGLET = ((-0.58, 1.30, -0.045), (-0.70, 1.34, -0.42), 0.25, 0.17, 1)
SENSOR = (0.22, 0.02, -0.06)  # accelerometers, m
SERVO, MOTOR_TAU, DELAY = (0.72, 40.0), 0.08, 0.024  # damping and rad/s; s; s
SURFACES = ("canard", "elevon_l", "elevon_r", "rud_l", "rud_r")
FANS, ROTORS = ("fan_l", "fan_r"), ("fan_l", "fan_r", "push")
SIGMAS = {
    "wing.lift_zero": 0.03,
    "wing.lift_slope": 0.04,
    "wing.roll_damping": 0.03,
    "wing.pitch_damping": 0.05,
    "wing.sideslip": 0.05,
    "wing.drag_zero": 0.05,
    "wing.moment": 0.05,
    "canard.lift_slope": 0.04,
    "canard.pitch_damping": 0.04,
    "winglets.side_force": 0.04,
    "winglets.yaw_damping": 0.04,
    "body.pitch_moment": 0.05,
    "body.side_force": 0.05,
    "body.yaw_moment": 0.05,
    "fans.edgewise": 0.05,
    "fans.inflow": 0.05,
    "fans.intake": 0.04,
    "push.advance": 0.05,
}
SIGMAS |= of_actuators(SURFACES, ROTORS)

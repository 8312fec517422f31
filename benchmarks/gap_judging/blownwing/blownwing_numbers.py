"""Numbers of the blown wing that the truth and its owner share."""

from scatter import of_actuators

AREA, CHORD, SPAN, SWEEP = 1.216, 0.384, 3.2, 0.47  # m2, mean chord in m, m, rad
ROOT_X, ROOT_CHORD, TIP_CHORD, DIHEDRAL = 0.355, 0.46, 0.30, 0.03  # quarter-chord point at the root, m; rad
# From the middle to the tip, m: the body, both sides of four propellers, and the drag rudder.
EDGES = (0.0, 0.20, 0.35, 0.50, 0.65, 0.80, 0.95, 1.10, 1.25, 1.40, 1.60)
PROP_R = 0.10  # m
SENSOR = (0.15, -0.02, 0.03)  # accelerometers, m
SERVO, MOTOR_TAU, DELAY = (0.75, 42.0), 0.065, 0.020  # damping and rad/s; s; s
SURFACES = ("inner_l", "inner_r", "outer_l", "outer_r", "drag_l", "drag_r")
ROTORS = ("l4", "l3", "l2", "l1", "r1", "r2", "r3", "r4")  # from the left tip to the right one
SIGMAS = {
    "wing.lift_zero": 0.03,
    "wing.lift_slope": 0.04,
    "wing.roll_damping": 0.03,
    "wing.pitch_damping": 0.05,
    "wing.sideslip": 0.05,
    "wing.drag_zero": 0.05,
    "wing.moment": 0.05,
    "body.pitch_moment": 0.05,
    "body.side_force": 0.05,
    "body.yaw_moment": 0.05,
    "props.advance": 0.05,
    "jets.strength": 0.05,
    "jets.swirl": 0.08,
}
SIGMAS |= of_actuators(SURFACES, ROTORS)

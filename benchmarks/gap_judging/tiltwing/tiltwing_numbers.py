"""Numbers of the tilt-wing that the truth and its owner share."""

from scatter import of_actuators

AREA, SPAN, CHORD = 1.2, 2.0, 0.30  # m2, m, m
EDGES = (0.14, 0.33, 0.55, 0.77, 1.0)  # of strips of a half wing, from the body to the tip, m
HALF = CHORD * (EDGES[-1] - EDGES[0])  # area of a half wing, m2
PIVOTS = ((0.60, 0.06), (-0.60, -0.14))  # x and z of the front and the rear hinge, m
PROP_R, PROP_Y, AHEAD = 0.22, 0.55, 0.28  # m: radius, place along the wing, disc before the hinge
TILTS = {19.0: (0.315, 0.367), 22.0: (0.212, 0.265)}  # by speed, front and rear, rad
FIN = {"x": -1.05, "z": -0.30, "area": 0.11}  # m, m2
SENSOR = (0.08, 0.02, -0.04)  # accelerometers, m
SERVO, MOTOR_TAU, DELAY = (0.72, 38.0), 0.075, 0.021  # damping and rad/s; s; s
SURFACES = ("el_fl", "el_fr", "el_rl", "el_rr")
ROTORS = ("pr_fl", "pr_fr", "pr_rl", "pr_rr")
SIGMAS = {
    "front.lift": 0.03,
    "front.chord_force": 0.05,
    "rear.lift": 0.03,
    "rear.chord_force": 0.05,
    "rear.downwash": 0.05,
    "wings.moment": 0.05,
    "wings.roll_damping": 0.03,
    "wings.pitch_damping": 0.04,
    "fin.side_force": 0.04,
    "fin.yaw_damping": 0.04,
    "body.side_force": 0.05,
    "body.yaw_moment": 0.05,
    "body.pitch_moment": 0.05,
    "props.inflow": 0.05,
    "props.edgewise": 0.05,
    "props.inplane": 0.05,
    "jets.strength": 0.05,
}
SIGMAS |= of_actuators(SURFACES, ROTORS)

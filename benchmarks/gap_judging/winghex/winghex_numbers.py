"""Numbers of the winged hexacopter that the truth and its owner share."""

from scatter import of_actuators

AREA, SPAN, CHORD = 0.68, 1.7, 0.40  # m2, m, m
WING_X, WING_Z, INCIDENCE = -0.03, 0.05, 0.145  # quarter chord, m; chord above the body's axis, rad
ROTOR_R, HEIGHT = 0.24, -0.10  # m: radius, hubs
TAIL = {"x": -1.35, "z": -0.36, "area": 0.13, "half": 0.17}  # m, m, m2, m: middle of each half
FIN = {"x": -1.30, "z": -0.20, "area": 0.075}  # m, m, m2
HALF_Y, MIDDLE = 0.42, {"angle": 0.13, "wake": 0.26}  # m; what the owner takes off inputs of a half wing
SENSOR = (0.06, -0.015, 0.03)  # accelerometers, m
SERVO, MOTOR_TAU, DELAY = (0.7, 40.0), 0.07, 0.02  # damping and rad/s; s; s
SURFACES = ("ail_l", "ail_r", "elev", "rud")
ROTORS = ("ro_fl", "ro_fr", "ro_ml", "ro_mr", "ro_rl", "ro_rr")
SIGMAS = {
    "wing.lift": 0.03,
    "wing.chord_force": 0.05,
    "wing.moment": 0.05,
    "wing.roll_damping": 0.03,
    "rear.downwash": 0.05,
    "tail.lift_slope": 0.04,
    "tail.downwash": 0.05,
    "tail.pitch_damping": 0.04,
    "fin.side_force": 0.04,
    "fin.yaw_damping": 0.04,
    "body.drag": 0.05,
    "body.side_force": 0.05,
    "body.yaw_moment": 0.05,
    "body.pitch_moment": 0.05,
    "props.inflow": 0.05,
    "props.edgewise": 0.05,
    "props.inplane": 0.05,
    "jets.strength": 0.05,
}
SIGMAS |= of_actuators(SURFACES, ROTORS)

"""Numbers of the T-tail that the truth and its owner share."""

from scatter import of_actuators

AREA, SPAN, CHORD = 1.296, 3.6, 0.36  # m2, m, m
WING_X, WING_Z, INCIDENCE, DIHEDRAL = 0.05, -0.05, 0.04, 0.06  # quarter chord, m; rad
FLAPS, AILERONS = (0.10, 1.20), (1.20, 1.72)  # m from the middle
RADIUS = (0.16, 0.20)  # m: of the propellers at the tips, and of those before the flaps
TAIL = {"x": -1.65, "z": -0.65, "area": 0.27}  # m, m, m2
FIN = {"x": -1.55, "z": -0.30, "area": 0.20}  # m, m, m2
HALF_Y, MIDDLE = 0.80, {"angle": 0.04, "tip": 0.06, "inner": 0.10}  # m; what the owner takes off inputs
SENSOR = (0.10, 0.02, 0.04)  # accelerometers, m
SERVO, MOTOR_TAU, DELAY = (0.7, 36.0), 0.09, 0.02  # damping and rad/s; s; s
SURFACES = ("ail_l", "ail_r", "flap_l", "flap_r", "elev", "rud")
ROTORS = ("tip_l", "tip_r", "in_l", "in_r")
SIGMAS = {
    "wing.lift": 0.03,
    "wing.chord_force": 0.05,
    "wing.moment": 0.05,
    "wing.roll_damping": 0.03,
    "wing.dihedral": 0.05,
    "tail.lift_slope": 0.04,
    "tail.downwash": 0.05,
    "tail.pitch_damping": 0.04,
    "tail.pressure": 0.02,
    "fin.side_force": 0.04,
    "fin.yaw_damping": 0.04,
    "body.drag": 0.05,
    "body.side_force": 0.05,
    "body.yaw_moment": 0.05,
    "body.pitch_moment": 0.05,
    "props.inflow": 0.01,
    "props.inplane": 0.05,
    "jets.strength": 0.05,
}
SIGMAS |= of_actuators(SURFACES, ROTORS)

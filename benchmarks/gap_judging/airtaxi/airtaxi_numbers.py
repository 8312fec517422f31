"""Numbers of the air taxi that the truth and its owner share."""

from scatter import of_actuators

AREA, SPAN, CHORD = 14.3, 11.0, 1.3  # m2, m, m: mean
CHORDS = (1.6, 1.0)  # m, in the middle and at the tips
WING_X, WING_Z, INCIDENCE, DIHEDRAL = 0.45, -0.6, 0.07, 0.05  # quarter chord, m; rad
FLAPERON = (2.6, 5.3)  # m from the middle
RADIUS = (1.0, 1.3)  # m, of propellers and of lifting rotors
STAB = {"x": -5.3, "z": -0.35, "area": 2.8, "y": 1.05}  # m, m, m2 and m of each half
FIN = {"x": -5.2, "z": -0.75, "area": 1.9}  # m, m, m2
HALF_Y, MIDDLE = 2.5, {"angle": 0.12, "outer": 0.07, "inner": 0.07}  # m; what the owner takes off inputs
SENSOR = (0.6, 0.05, 0.2)  # accelerometers, m
SERVO, MOTOR_TAU, DELAY = (0.75, 22.0), 0.25, 0.03  # damping and rad/s; s; s
SURFACES = ("ail_l", "ail_r", "stab_l", "stab_r", "rud")
PROPELLERS = ("pr_ol", "pr_il", "pr_ir", "pr_or")
ROTORS = (*PROPELLERS, "li_l", "li_r")
SIGMAS = {
    "wing.lift": 0.03,
    "wing.chord_force": 0.05,
    "wing.moment": 0.05,
    "wing.roll_damping": 0.03,
    "wing.dihedral": 0.05,
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
    "props.inflow": 0.01,
    "lifts.inflow": 0.05,
    "props.inplane": 0.05,
    "jets.strength": 0.05,
}
SIGMAS |= of_actuators(SURFACES, ROTORS)

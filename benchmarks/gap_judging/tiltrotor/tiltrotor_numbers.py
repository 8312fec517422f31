"""Numbers of the tilt-rotor that the truth and its owner share."""

from scatter import of_actuators
from wing import Wing

WING = Wing(
    area=1.1,
    chord=0.34,
    y_inner=0.55,
    y_outer=1.25,
    outer_share=0.22,
    slope=4.8,
    zero=-0.07,
    dihedral=0.05,
    drag=0.065,
    induced=0.046,
    quartic=0.0025,
    owner_drag=0.0646,
    owner_induced=0.0502,
    aileron=2.5,
    moment=-0.04,
    centre=0.07,
    flap=2.2,
)
TAIL_X, TAIL_AREA, TAIL_SLOPE, ELEVATOR, TAIL_SET = -1.25, 0.24, 4.0, 2.1, -0.11  # m, m2, per rad, rad
WASH_ZERO, WASH = 0.012, 0.32  # downwash at zero lift and per angle of attack
FIN_Y, FIN_Z, FIN_AREA, FIN_SLOPE, RUDDER = 0.45, -0.10, 0.075, 3.2, 1.7  # of each fin
SENSOR = (0.10, -0.02, 0.05)  # accelerometers, m
SERVO, MOTOR_TAU, DELAY = (0.7, 36.0), 0.085, 0.022  # damping and rad/s; s; s
SURFACES = ("ail_l", "ail_r", "flap_l", "flap_r", "elev", "rud")
ROTORS = ("in_l", "in_r", "out_l", "out_r", "aft_l", "aft_r")
SIGMAS = {
    "wing.lift_zero": 0.03,
    "wing.lift_slope": 0.04,
    "wing.drag_zero": 0.05,
    "wing.drag_induced": 0.05,
    "wing.moment": 0.05,
    "wing.dihedral": 0.05,
    "wing.roll_damping": 0.03,
    "tail.lift_slope": 0.04,
    "tail.downwash": 0.05,
    "tail.pitch_damping": 0.04,
    "fin.side_force": 0.04,
    "fin.yaw_damping": 0.04,
    "body.side_force": 0.05,
    "body.yaw_moment": 0.05,
    "body.pitch_moment": 0.05,
    "tilt_rotors.inflow": 0.05,
    "tilt_rotors.edgewise": 0.05,
    "lift_rotors.inflow": 0.05,
    "lift_rotors.edgewise": 0.05,
}
SIGMAS |= of_actuators(SURFACES, ROTORS)

"""Numbers of the quadplane that the truth and its owner share."""

from scatter import of_actuators
from wing import Wing

WING = Wing(
    area=0.9,
    chord=0.3,
    y_inner=0.4,
    y_outer=1.1,
    outer_share=0.22,
    slope=5.1,
    zero=-0.07,
    dihedral=0.07,
    drag=0.036,
    induced=0.040,
    quartic=0.004,
    owner_drag=0.0356,
    owner_induced=0.0440,
    aileron=2.6,
    moment=-0.02,
    centre=0.012,
)
SENSOR = (0.08, 0.01, -0.04)  # accelerometers, m
SERVO, MOTOR_TAU, DELAY = (0.75, 42.0), 0.07, 0.02  # damping and rad/s; s; s
_SURFACES = ("ail_l", "ail_r", "elev", "rud")
_ROTORS = ("lift1", "lift2", "lift3", "lift4", "push")
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
    "lift_rotors.inflow": 0.05,
    "lift_rotors.edgewise": 0.05,
    "push.advance": 0.05,
}
SIGMAS |= of_actuators(_SURFACES, _ROTORS)

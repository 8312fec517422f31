"""Numbers of the V-tailed airplane that the truth and its owner share."""

from wing import Wing

WING = Wing(
    area=0.62,
    chord=0.27,
    y_inner=0.30,
    y_outer=0.85,
    outer_share=0.21,
    slope=4.9,
    zero=-0.05,
    dihedral=0.09,
    drag=0.030,
    induced=0.045,
    quartic=0.006,
    owner_drag=0.0295,
    owner_induced=0.0495,
    aileron=2.4,
    moment=-0.03,
    centre=-0.008,
)
PANEL_ANGLE, PANEL_AREA, TAIL_X, TAIL_Y, TAIL_Z = 0.66, 0.075, -0.95, 0.20, -0.14  # rad, m2, m
PANEL_SLOPE, RUDDERVATOR, PANEL_SET = 3.6, 2.3, -0.045
WASH_ZERO, WASH = 0.010, 0.34
HUB_X, HUB_Z, HUB_R = 0.5, 0.02, 0.21
SENSOR = (0.06, -0.01, -0.03)
SERVO, MOTOR_TAU, DELAY = (0.8, 38.0), 0.09, 0.025
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
    "tail.yaw_damping": 0.04,
    "body.side_force": 0.05,
    "body.yaw_moment": 0.05,
    "body.pitch_moment": 0.05,
    "prop.advance": 0.05,
    "prop.thrust": 0.03,
    "prop.torque": 0.03,
    "prop.time_constant": 0.05,
}
for _name in ("ail_l", "ail_r", "ruv_l", "ruv_r"):
    SIGMAS[f"{_name}.effectiveness"] = 0.03
    SIGMAS[f"{_name}.natural_frequency"] = 0.05
    SIGMAS[f"{_name}.damping"] = 0.05
    SIGMAS[f"{_name}.gain"] = 0.01

"""The columns of SIDPAC's standard data matrix, theirs beside ours.

Names and units are those that the files carry themselves (``fds.varlab``, ``fds.varunits``).
"""

from __future__ import annotations

WIDTH = 90

# column (from 1), its name there, its unit there, our channel
CHANNELS = (
    (2, "V", "fps", "air/V"),
    (3, "beta", "deg", "air/beta"),
    (4, "alpha", "deg", "air/alpha"),
    (5, "p", "dps", "state/p"),
    (6, "q", "dps", "state/q"),
    (7, "r", "dps", "state/r"),
    (8, "phi", "deg", "state/phi"),
    (9, "the", "deg", "state/theta"),
    (10, "psi", "deg", "state/psi"),
    (11, "ax", "g", "state/ax"),  # at the centre of gravity
    (12, "ay", "g", "state/ay"),
    (13, "az", "g", "state/az"),
    (14, "el", "deg", "effector/de"),
    (15, "ail", "deg", "effector/da"),
    (16, "rdr", "deg", "effector/dr"),
    (17, "tef", "deg", "effector/tef"),
    (18, "lef", "deg", "effector/lef"),
    (27, "qbar", "psf", "air/qbar"),
    (28, "mach", "", "air/mach"),
    (29, "rho", "slug/ft3", "air/rho"),
    (30, "alt", "ft", "state/alt"),
    (31, "lonstk", "in", "command/lonstk"),
    (32, "latstk", "in", "command/latstk"),
    (33, "rudped", "in", "command/rudped"),
    (34, "thtl", "deg", "command/thtl"),
    (38, "thrust", "lbf", "effector/thrust1"),
    (39, "", "lbf", "effector/thrust2"),  # the files leave its label blank
    (42, "pdot", "dps2", "state/pdot"),
    (43, "qdot", "dps2", "state/qdot"),
    (44, "rdot", "dps2", "state/rdot"),
    (58, "ptv", "deg", "effector/ptv"),
    (59, "qtv", "deg", "effector/qtv"),
    (60, "rtv", "deg", "effector/rtv"),
    (61, "CX", "", "response/CX"),
    (62, "CY", "", "response/CY"),
    (63, "CZ", "", "response/CZ"),
    (64, "Cl", "", "response/Cl"),
    (65, "Cm", "", "response/Cm"),
    (66, "Cn", "", "response/Cn"),
    (71, "phat", "", "air/phat"),
    (72, "qhat", "", "air/qhat"),
    (73, "rhat", "", "air/rhat"),
    (74, "u", "fps", "state/u"),
    (75, "v", "fps", "state/v"),
    (76, "w", "fps", "state/w"),
)

# Fuselage stations count aft and waterlines up, so x and z change sign in vehicle axes. Their Ixz
# is the integral of + x z dm, as ours, and both signs change together.
MASS = (
    (45, "xcg", "in", "cg_x", -1),
    (46, "ycg", "in", "cg_y", 1),
    (47, "zcg", "in", "cg_z", -1),
    (48, "mass", "slug", "mass", 1),
    (49, "Ixx", "slug-ft2", "Ixx", 1),
    (50, "Iyy", "slug-ft2", "Iyy", 1),
    (51, "Izz", "slug-ft2", "Izz", 1),
    (52, "Ixz", "slug-ft2", "Ixz", 1),
)
GEOMETRY = ((77, "sarea", "ft2", "area_m2"), (78, "bspan", "ft", "span_m"), (79, "cbar", "ft", "chord_m"))

# As measured, where the sensor is: a record that says where its accelerometers are writes them here.
MEASURED_ACCELERATION = {"state/ax": (53, "axm"), "state/ay": (54, "aym"), "state/az": (55, "azm")}

# Blank in the layout; further effectors are written here under their own name and read by it.
SPARE = (*range(19, 27), 35, 36, 37, 40, 41, *range(80, 91))

# Units that the files spell in a way of their own.
SPELLED = {"": "1", "dps2": "deg/s2", "sec": "s"}

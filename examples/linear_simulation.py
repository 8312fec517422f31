"""A simulation of the aircraft of ``linear_record.py``, as a user may have it: for ``diagnose-gap --sim``."""

MASS, GRAVITY, SPEED, ROTOR = 28.6, 9.80665, 20.0, 420.0  # kg, m/s2, m/s, rad/s
ELEVATOR = 0.02  # rad, at trim


def wrench(time, state, effector, air, parameters):
    """Return forces and moments, N and N m, on the states and positions that were flown."""
    u, v, w = state["u"] - SPEED, state["v"], state["w"]
    p, q, r = state["p"], state["q"], state["r"]
    de, da, dr = effector["de"] - ELEVATOR, effector["da"], effector["dr"]
    n1 = effector["n1"] - ROTOR
    return {
        "X": -6.0 * u + 4.0 * w + 0.5 * q - 5.0 * de + 0.9 * n1,
        "Y": -14.0 * v + 0.6 * p + 2.5 * r + 2.0 * da + 30.0 * dr,
        "Z": -28.0 * u - 95.0 * w - 12.0 * q - 60.0 * de - 0.3 * n1 - MASS * GRAVITY,
        "L": -5.0 * v - 16.0 * p + 3.0 * r + 45.0 * da + 2.5 * dr,
        "M": 0.4 * u - 9.0 * w - 18.0 * q - 42.0 * de + 0.05 * n1,
        "N": 8.0 * v - 0.8 * p - 9.0 * r - 1.5 * da - 22.0 * dr,
    }


wrench.responses = ("X", "Y", "Z", "L", "M", "N")

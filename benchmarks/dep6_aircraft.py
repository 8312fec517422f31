"""Make the tables of ``scenarios/dep6.toml``: an aircraft with six propellers in front of its wing.

Its derivatives follow from momentum theory: the slipstream of a propeller of thrust coefficient ``Tc`` is
``sqrt(1 + Tc)`` times as fast as the free stream, it washes a part of the wing, of the tail and of the fin,
and it straightens the flow that it washes them with. None of the formulas is an exponential of the advance
ratio. Run as ``python benchmarks/dep6_aircraft.py`` to print the section ``[simulation.coefficients]``.

References
----------
B. W. McCormick, *Aerodynamics, Aeronautics, and Flight Mechanics*, 2nd ed., Wiley, 1995, ch. 6 (momentum
theory of propellers) and ch. 9 (tail and downwash).
"""

from __future__ import annotations

from math import pi

import numpy as np

THRUST = (0.120, -0.110, -0.035, -0.002)  # c0 to c3 of CT, as in freqid.simulate.loads.propeller
TORQUE = (0.0085, 0.0030, -0.0040, -0.0075)
J = (0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.1, 1.2)
J = (*J, 1.4, 1.7, 2.2, 3.0, 5.0, 10.0, 1000.0)
ALPHA = np.linspace(-0.08, 0.24, 33)  # rad, where polynomials stand for the formulas
DEGREE = {"CL": 3, "CD": 4, "Cm": 3}

WASHED = 0.62  # share of the wing behind the propellers
DEVELOPED = 0.9  # share of the far slipstream's speed at the wing
WASHED_TAIL, WASHED_FIN, WASHED_AILERON = 0.45, 0.30, 0.50
SLOPE, ZERO_LIFT, ROUNDING = 4.8, -0.05, 1.2  # of the wing: per rad, rad, and per rad^2
ASPECT, CG_BEHIND = 8.0, 0.05  # aspect ratio; centre of gravity behind the wing's aerodynamic centre, chords
TAIL_SLOPE, TAIL_AREA, TAIL_ARM, TAIL_ANGLE = 3.6, 0.20, 3.2, -0.045  # per rad, of S, chords, rad
ELEVATOR = 0.45  # change of the tail's angle by elevator angle


def faster(j):
    """Return the speed of the slipstream at the wing over the airspeed."""
    j = np.asarray(j, dtype=float)
    c0, c1, c2, c3 = THRUST
    x = 1 / j
    thrust = c0 * x**2 + c1 * x + (c2 + c3 * j) / np.sqrt(1 + j**2)  # T / rho V^2 D^2
    return 1 + DEVELOPED * (np.sqrt(1 + 8 / pi * thrust) - 1)


def washed(share, j):
    """Return the mean dynamic pressure of a part over that of the free stream."""
    return 1 + share * (faster(j) ** 2 - 1)


def wing_lift(alpha, j):
    """Return the wing's lift coefficient."""

    def section(angle):
        return SLOPE * (angle - ZERO_LIFT) * (1 - ROUNDING * (angle - ZERO_LIFT) ** 2)

    k = faster(j)
    inside = np.arctan2(np.sin(alpha), np.cos(alpha) + k - 1)
    return (1 - WASHED) * section(alpha) + WASHED * k**2 * section(inside)


def tail_lift(alpha, j):
    """Return the tail's lift coefficient, of the wing's area."""
    downwash = 2 * wing_lift(alpha, j) / (pi * ASPECT)
    return TAIL_AREA * TAIL_SLOPE * washed(WASHED_TAIL, j) * (alpha - downwash + TAIL_ANGLE)


def statics(alpha, j):
    """Return CL, CD and Cm without control deflections, without thrust."""
    wing, tail, k = wing_lift(alpha, j), tail_lift(alpha, j), faster(j)
    lift = wing + tail
    drag = 0.035 + 0.012 * WASHED * (k**2 - 1) + lift**2 / (pi * ASPECT * 0.8)
    moment = -0.05 * washed(WASHED, j) + CG_BEHIND * wing - TAIL_ARM * tail
    return lift, drag, moment


def derivatives(j):
    """Return all other derivatives by coefficient and variable."""
    one = np.ones_like(np.asarray(j, dtype=float))
    tail, fin, aileron = (washed(share, j) for share in (WASHED_TAIL, WASHED_FIN, WASHED_AILERON))
    lift = TAIL_AREA * TAIL_SLOPE * tail
    return {
        "CL": {"qhat": 2 * TAIL_ARM * lift, "de": ELEVATOR * lift},
        "Cm": {"qhat": -2 * TAIL_ARM**2 * lift, "de": -TAIL_ARM * ELEVATOR * lift},
        "CY": {"beta": -0.25 - 0.30 * fin, "rhat": 0.20 * fin, "dr": 0.16 * fin},
        "Cl": {
            "beta": -0.02 - 0.03 * fin - 0.04 * washed(WASHED, j),
            "phat": -0.25 - 0.22 * faster(j),
            "rhat": 0.12 * one,
            "da": 0.16 * aileron,
            "dr": 0.008 * fin,
        },
        "Cn": {
            "beta": -0.03 + 0.11 * fin,
            "phat": -0.03 * one,
            "rhat": -0.02 - 0.10 * fin,
            "da": -0.008 * one,
            "dr": -0.075 * fin,
        },
    }


def polynomials(j):
    """Return CL, CD and Cm without control deflections as polynomials of the angle of attack.

    Parameters
    ----------
    j : ndarray, shape (n,)

    Returns
    -------
    dict of ndarray, shape (degree + 1, n)
        Constant first.
    """
    fits = zip(("CL", "CD", "Cm"), statics(ALPHA[:, None], j), strict=True)
    return {name: np.polynomial.polynomial.polyfit(ALPHA, values, DEGREE[name]) for name, values in fits}


def section():
    """Return the tables as lines of TOML."""
    j = np.array(J)
    lines, static, others = [], polynomials(j), derivatives(j)
    for name in ("CD", "CL", "Cm", "CY", "Cl", "Cn"):
        lines.append(f"[simulation.coefficients.{name}]")
        terms = {}
        for power, values in enumerate(static.get(name, ())):
            terms["*".join(["alpha"] * power) or "bias"] = values
        for term, values in {**terms, **others.get(name, {})}.items():
            key = f'"{term}"' if "*" in term else term
            table = f'{{ of = "J", at = {_row(j)}, values = {_row(values)} }}'
            lines.append(f"{key} = {values[0]:.6g}" if np.ptp(values) == 0 else f"{key} = {table}")
        lines.append("")
    return "\n".join(lines)


def _row(values):
    return "[" + ", ".join(f"{value:.6g}" if value % 1 else f"{value:.1f}" for value in values) + "]"


if __name__ == "__main__":
    print(section())

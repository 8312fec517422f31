"""Manoeuvres of a blown aircraft, integrated by scipy with formulas of their own."""

import numpy as np
from scipy.integrate import solve_ivp

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.scenario import Airframe, Scenario
from freqid.core.sections.identification import Identification
from freqid.core.sections.trim_sequence import Campaign, CampaignTrim
from freqid.core.vehicle import Effector, Inertia, Rotor

MASS, AREA, CHORD, INERTIA, RHO, G = 6.0, 0.5, 0.25, 0.38, 1.2, 9.80665
DIAMETER = 0.23
REGRESSORS = ("alpha", "qhat", "de")
SCENARIO = Scenario(
    vehicle=Airframe(
        name="blown",
        mass_kg=MASS,
        inertia=Inertia(xx=0.48, yy=INERTIA, zz=0.8),
        area_m2=AREA,
        span_m=2.0,
        chord_m=CHORD,
    ),
    effector=(
        Effector(name="de", kind="surface", limits=(-0.5, 0.5)),
        Effector(name="n1", kind="rotor", limits=(0.0, 2000.0)),
    ),
    rotor=(Rotor(name="n1", spin=1, inertia=0.0, diameter_m=DIAMETER),),
    identification=Identification(
        responses=("X", "Z", "M"), regressors=REGRESSORS, form="coefficient", method="time"
    ),
    campaign=Campaign(trim=(CampaignTrim(speed=15.0),)),
)


def derivatives(j):
    """Return coefficients with constants first, of X, Z and M: exponentials of J in four of them."""
    e = np.exp(-4 * j)
    return {
        "CX": (0.02 + 0.3 * e, 0.3, 0.0, 0.0),
        "CZ": (-0.15 - 0.8 * e, -5.0, -5.0, -0.35),
        "Cm": (0.02, -0.9, -14.0, -1.0 - 2.0 * e),
    }


def flown(j, seed):
    rng = np.random.default_rng(seed)
    time = np.arange(0, 8, 0.02)
    of = derivatives(j)

    def elevator(t):
        return (
            -0.05 + 0.06 * np.sin(2.1 * t) * np.sin(5.3 * t + 0.4) + 0.04 * np.exp(-(((t - 1.3) / 0.25) ** 2))
        )

    def applied(v, alpha, q, t):
        x = np.array([np.ones_like(alpha), alpha, q * CHORD / (2 * v), elevator(t)])
        return {name: np.tensordot(c, x, 1) * 0.5 * RHO * v**2 * AREA for name, c in of.items()}

    def rates(t, s):
        u, w, q, theta = s
        v, alpha = np.hypot(u, w), np.arctan2(w, u)
        f = applied(v, alpha, q, t)
        return [
            f["CX"] / MASS - q * w - G * np.sin(theta),
            f["CZ"] / MASS + q * u + G * np.cos(theta),
            f["Cm"] * CHORD / INERTIA,
            q,
        ]

    u, w, q, theta = solve_ivp(rates, (0, 8), (15.0, 1.0, 0.0, 0.08), t_eval=time, rtol=1e-9, atol=1e-9).y
    v, alpha = np.hypot(u, w), np.arctan2(w, u)
    f = applied(v, alpha, q, time)
    none, turning = 0 * v, 2 * np.pi * v.mean() / (j * DIAMETER) if np.isfinite(j) else 0.0
    true = {
        "air/V": (v, "m/s", 0.05), "air/alpha": (alpha, "rad", 0.001), "air/beta": (none, "rad", 0.0),
        "air/rho": (none + RHO, "kg/m3", 0.0), "effector/n1": (none + turning, "rad/s", 0.0),
        "effector/de": (elevator(time), "rad", 0.0), "state/p": (none, "rad/s", 0.0),
        "state/q": (q, "rad/s", 0.002), "state/r": (none, "rad/s", 0.0), "state/phi": (none, "rad", 0.0),
        "state/theta": (theta, "rad", 0.001), "state/ax": (f["CX"] / MASS, "m/s2", 0.03),
        "state/ay": (none, "m/s2", 0.0), "state/az": (f["CZ"] / MASS, "m/s2", 0.03),
    }  # fmt: skip
    channels = {
        n: Channel(n, unit, x + s * rng.standard_normal(x.size), 50.0, "scipy")
        for n, (x, unit, s) in true.items()
    }
    return Maneuver(FlightRecord(time, channels), SCENARIO.aircraft())


def one_flight(ratios, seed=0, rest_s=4.0):
    """Return one record of manoeuvres at several advance ratios, with the elevator at rest between them."""
    pieces = [flown(j, seed + i).record for i, j in enumerate(ratios)]
    rest = round(rest_s / 0.02)
    joined = {}
    for name, channel in pieces[0].channels.items():
        parts = []
        for piece in pieces:
            parts += [np.full(rest, piece[name][0]), piece[name]]
        parts.append(np.full(rest, pieces[-1][name][-1]))
        joined[name] = Channel(name, channel.unit, np.concatenate(parts), 50.0, "scipy")
    size = joined["air/V"].values.size
    moved = np.zeros(size)
    for i, piece in enumerate(pieces):
        start = rest + i * (rest + piece.time.size)
        moved[start : start + piece.time.size] = piece["effector/de"] + 0.05 + 1e-6
    joined["excitation/de"] = Channel("excitation/de", "rad", moved, 50.0, "scipy")
    return FlightRecord(0.02 * np.arange(size), joined, vehicle=SCENARIO.aircraft())

"""A manoeuvre of the linear aircraft as late sensors, a tilted horizon and a wind would have logged it."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.record import Channel, Maneuver

TRUTH = {
    "velocity delay": 0.035,
    "attitude delay": 0.01,
    "phi bias": 0.01,
    "theta bias": -0.012,
    "psi bias": 0.008,
    "p scale": 0.004,
    "q scale": -0.006,
    "r scale": 0.005,
    "surface delay": 0.008,
    "rotor delay": 0.04,
    "wind north": -4.0,
    "wind east": 3.0,
}
KIND = {"uvw": 0.1, "vnvevd": 0.1, "pqr": 0.002, "phithetapsi": 0.003, "axayaz": 0.1, "dedadr": 0.002}


def noise_of(name):
    return next((size for names, size in KIND.items() if name in names), 1.0)


def late(clean, seed, noise=1.0):
    """Return the manoeuvre with velocity over the ground in place of u v w, everything late as in TRUTH."""
    record, rng = clean.record, np.random.default_rng(seed)
    t = record.time

    def delayed(values, by):
        return CubicSpline(t, values)(np.clip(t - by, t[0], t[-1]))

    phi, theta, psi = record.matrix(("state/phi", "state/theta", "state/psi"))
    u, v, w = record.matrix(("state/u", "state/v", "state/w"))
    # one turn after another: roll, pitch, heading
    y, z = v * np.cos(phi) - w * np.sin(phi), v * np.sin(phi) + w * np.cos(phi)
    x, z = u * np.cos(theta) + z * np.sin(theta), z * np.cos(theta) - u * np.sin(theta)
    north, east = x * np.cos(psi) - y * np.sin(psi), x * np.sin(psi) + y * np.cos(psi)
    rows = {"state/vn": north + TRUTH["wind north"], "state/ve": east + TRUTH["wind east"], "state/vd": z}
    rows = {n: delayed(x, TRUTH["velocity delay"]) for n, x in rows.items()}
    for name, channel in record.channels.items():
        short = name.partition("/")[2]
        values = channel.values
        if name in ("state/u", "state/v", "state/w"):
            continue
        if f"{short} bias" in TRUTH:
            values = delayed(values, TRUTH["attitude delay"]) + TRUTH[f"{short} bias"]
        elif f"{short} scale" in TRUTH:
            values = (1 + TRUTH[f"{short} scale"]) * values
        elif name.startswith("effector/"):
            values = delayed(values, TRUTH["rotor delay" if short == "n1" else "surface delay"])
        rows[name] = values
    exact = ("excitation", "air")
    channels = {
        n: replace(record.channels[n], values=x) if n in record else Channel(n, "m/s", x, 50.0, "made")
        for n, x in rows.items()
    }
    for name, channel in channels.items():
        if name.partition("/")[0] not in exact:
            spread = noise * noise_of(name.partition("/")[2])
            channels[name] = replace(channel, values=channel.values + spread * rng.standard_normal(t.size))
    return Maneuver(replace(record, channels=channels), clean.vehicle)

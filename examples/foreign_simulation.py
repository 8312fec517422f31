"""A simulation of a small airplane as a user may have it, in numpy alone, and flights of the airplane itself.

``python examples/foreign_simulation.py FOLDER`` flies an airplane whose numbers are off by what the simulation
states in ``SIGMA``, and whose elevator answers ``EFFECT`` seconds late, which the simulation does not know.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.optimize import root
from scipy.signal import lsim

EFFECT = 0.06  # s, by which the elevator is late in flight; 0 for flights without a gap
STATED = 1.0  # of the scatter that flies: what the simulation states; try 0.5 and 3
SPEED, MASS, IYY, AREA, CHORD, RHO, G = 22.0, 12.0, 1.4, 0.7, 0.3, 1.225, 9.80665
SIGMA = {"lift_slope": 0.05, "drag": 0.10, "stability": 0.08, "pitch_damping": 0.10, "elevator_power": 0.05}
SIGMA |= {"thrust": 0.05, "elevator.natural_frequency": 0.05, "elevator.damping": 0.10, "elevator.gain": 0.02}


def wrench(time, state, effector, air, parameters):
    """Return X Z M about the centre of gravity, N and N m; `parameters` holds departures from nominal."""
    off = {name: 1 + parameters.get(name, 0.0) for name in SIGMA}
    u, w = state["u"], state["w"]
    alpha, qs = np.arctan2(w, u), 0.5 * RHO * (u * u + w * w) * AREA
    rate = state["q"] * CHORD / (2 * np.hypot(u, w))
    lift = qs * (0.25 + 4.8 * off["lift_slope"] * alpha + 6.0 * rate + 0.4 * effector["elevator"])
    drag = off["drag"] * qs * (0.035 + 0.06 * (0.25 + 4.8 * alpha) ** 2)
    pitch = 0.02 - 0.8 * off["stability"] * alpha - 14 * off["pitch_damping"] * rate
    return {
        "X": lift * np.sin(alpha) - drag * np.cos(alpha) + 60 * off["thrust"] * effector["throttle"],
        "Z": -lift * np.cos(alpha) - drag * np.sin(alpha),
        "M": qs * CHORD * (pitch - 1.2 * off["elevator_power"] * effector["elevator"]),
    }


def positions(time, command, parameters):
    """Return what a servo of second order makes of the elevator's command; the throttle follows at once."""
    frequency, damping, gain = (1 + parameters.get(f"elevator.{n}", 0.0) for n in ("natural_frequency", "damping", "gain"))
    w, z, first = 50.0 * frequency, 0.7 * damping, command["elevator"][0]
    moved = lsim(([w * w], [1, 2 * z * w, w * w]), command["elevator"] - first, time - time[0])[1]
    return {"elevator": gain * (first + moved), "throttle": command["throttle"]}


def fly(record, parameters):
    """Return states and effector positions of a flight from trim under the record's injected signals."""
    return flight(record.time, {n: record[f"excitation/{n}"] for n in ("elevator", "throttle")}, parameters)


wrench.responses, wrench.positions, wrench.fly = ("X", "Z", "M"), positions, fly
wrench.tolerances = {name: (STATED * sigma, "1") for name, sigma in SIGMA.items()}


def slope(x, elevator, throttle, parameters):
    u, w, q, theta = x
    load = wrench(0.0, {"u": u, "w": w, "q": q}, {"elevator": elevator, "throttle": throttle}, {}, parameters)
    ax, az = load["X"] / MASS, load["Z"] / MASS
    return np.array([ax - G * np.sin(theta) - q * w, az + G * np.cos(theta) + q * u, load["M"] / IYY, q])


def flight(time, injected, parameters, late=0.0):
    """Return channels of a flight; `late` shifts the elevator's command in time, s."""
    at = lambda y: np.array([SPEED * np.cos(y[0]), SPEED * np.sin(y[0]), 0.0, y[0]])  # noqa: E731
    trim = root(lambda y: slope(at(y), y[1], y[2], parameters)[:3], [0.05, 0.0, 0.2]).x
    command = {"elevator": trim[1] + injected["elevator"], "throttle": trim[2] + injected["throttle"]}
    sent = command | {"elevator": np.interp(time - late, time, command["elevator"])}
    d = np.array(list(positions(time, sent, parameters).values()))
    x, dt = np.empty((4, time.size)), time[1] - time[0]
    x[:, 0] = at(trim)
    for k in range(time.size - 1):
        middle, y = 0.5 * (d[:, k] + d[:, k + 1]), x[:, k]
        k1 = slope(y, *d[:, k], parameters)
        k2 = slope(y + dt / 2 * k1, *middle, parameters)
        k3 = slope(y + dt / 2 * k2, *middle, parameters)
        x[:, k + 1] = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + slope(y + dt * k3, *d[:, k + 1], parameters))
    channels = {f"state/{n}": row for n, row in zip(("u", "w", "q", "theta"), x, strict=True)}
    channels |= {"effector/elevator": d[0], "effector/throttle": d[1]}
    return channels | {f"command/{n}": y for n, y in command.items()}


def write_flights(folder, effect=EFFECT, seed=0):
    """Write three flights of one airplane as records: two to diagnose, one to hold out."""
    from freqid.core.channels import si_unit
    from freqid.core.record import Channel, FlightRecord
    from freqid.core.record_file import write_record
    from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle

    rng = np.random.default_rng(seed)
    truth = {name: sigma * rng.standard_normal() for name, sigma in SIGMA.items()}
    limits = {"elevator": ("surface", (-0.4, 0.4)), "throttle": ("throttle", (0.0, 1.0))}
    noise = {"u": 0.1, "w": 0.1, "q": 0.002, "theta": 0.002, "ax": 0.05, "az": 0.05, "elevator": 1e-3, "throttle": 2e-3}
    noise |= {"v": 0.1, "p": 0.002, "r": 0.002, "phi": 0.002, "psi": 0.002, "ay": 0.05}
    body = MassProperties(mass_kg=MASS, inertia=Inertia(xx=1.0, yy=IYY, zz=2.2))
    effectors = tuple(Effector(name=n, kind=kind, limits=span) for n, (kind, span) in limits.items())
    vehicle = Vehicle(name="small airplane", mass_properties=body, effectors=effectors, area_m2=AREA, chord_m=CHORD)
    time = 0.02 * np.arange(3001)
    for number in (1, 2, 3):
        injected = {}
        for i, (name, size) in enumerate({"elevator": 0.04, "throttle": 0.08}.items()):
            hz = np.arange(3 + i, 108, 2) / 60
            tones = np.sin(2 * np.pi * np.outer(hz, time) + rng.uniform(0, 2 * np.pi, (hz.size, 1)))
            injected[name] = size * np.sqrt(2 / hz.size) * tones.sum(axis=0)
        clean = flight(time, injected, truth, effect)
        state = {n: clean[f"state/{n}"] for n in ("u", "w", "q")}
        load = wrench(time, state, {n: clean[f"effector/{n}"] for n in limits}, {}, truth)
        clean |= {"state/ax": load["X"] / MASS, "state/az": load["Z"] / MASS, "air/rho": RHO + 0 * time}
        clean |= {f"state/{n}": 0 * time for n in ("v", "p", "r", "phi", "psi", "ay")}
        clean |= {f"excitation/{n}": x for n, x in injected.items()}
        channels = {}
        for name, x in clean.items():
            group, _, short = name.partition("/")
            measured = x + noise[short] * rng.standard_normal(x.size) if group in ("state", "effector") else x
            unit = si_unit(name) or {"elevator": "rad", "throttle": "1"}[short]
            channels[name] = Channel(name, unit, measured, 50.0, "simulated")
        write_record(Path(folder) / f"flight{number}.h5", FlightRecord(time, channels, vehicle, reference="cruise"))


if __name__ == "__main__":
    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    write_flights(sys.argv[1])

"""A simulation of a small airplane as a user may have it, in numpy and scipy, and flights of the airplane.

``python examples/foreign_simulation.py FOLDER`` flies an airplane whose numbers are off by what ``SIGMA``
states, and whose elevator answers ``EFFECT`` seconds late, which the simulation does not know.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.signal import cont2discrete, lfilter

EFFECT = 0.06  # s, by which the elevator is late in flight; 0 for flights without a gap
STATED = 1.0  # what the simulation states, of the scatter that flies; try 0.5 and 3
SPEED, MASS, IYY, AREA, CHORD, RHO, G = 22.0, 12.0, 1.4, 0.7, 0.3, 1.225, 9.80665
SIGMA = {"lift_slope": 0.05, "drag": 0.10, "stability": 0.08, "pitch_damping": 0.10, "elevator_power": 0.05}
SIGMA |= {"thrust": 0.05, "elevator.natural_frequency": 0.05, "elevator.damping": 0.10, "elevator.gain": 0.02}
NOISE = {"u": 0.1, "v": 0.1, "w": 0.1, "p": 0.002, "q": 0.002, "r": 0.002, "phi": 0.002, "theta": 0.002}
NOISE |= {"psi": 0.002, "ax": 0.05, "ay": 0.05, "az": 0.05, "elevator": 1e-3, "throttle": 2e-3}


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
    w = 50.0 * (1 + parameters.get("elevator.natural_frequency", 0.0))
    z = 0.7 * (1 + parameters.get("elevator.damping", 0.0))
    first = command["elevator"][0]
    above, below, _ = cont2discrete(([w * w], [1, 2 * z * w, w * w]), time[1] - time[0], method="foh")
    moved = lfilter(above.ravel(), below, command["elevator"] - first)
    gain = 1 + parameters.get("elevator.gain", 0.0)
    return {"elevator": gain * (first + moved), "throttle": command["throttle"]}


def fly(record, parameters):
    """Return states, positions and commands of a flight from trim under the record's injected signals."""
    return flight(record.time, {n: record[f"excitation/{n}"] for n in ("elevator", "throttle")}, parameters)


wrench.responses, wrench.positions, wrench.fly = ("X", "Z", "M"), positions, fly
wrench.tolerances = {name: (STATED * sigma, "1") for name, sigma in SIGMA.items()}


def flight(time, injected, parameters, late=0.0):
    """Return channels of a flight; `late` shifts the elevator's command in time, s."""

    def slope(x, elevator, throttle):
        state, effector = dict(zip("uwq", x, strict=False)), {"elevator": elevator, "throttle": throttle}
        load = wrench(0.0, state, effector, {}, parameters)
        ax, az = load["X"] / MASS - G * np.sin(x[3]), load["Z"] / MASS + G * np.cos(x[3])
        return np.array([ax - x[2] * x[1], az + x[2] * x[0], load["M"] / IYY, x[2]])

    def level(angle):
        return np.array([SPEED * np.cos(angle), SPEED * np.sin(angle), 0.0, angle])

    trim = root(lambda y: slope(level(y[0]), *y[1:])[:3], [0.05, 0.0, 0.2]).x
    command = {n: trim[k] + injected[n] for k, n in ((1, "elevator"), (2, "throttle"))}
    sent = command | {"elevator": np.interp(time - late, time, command["elevator"])}
    d = positions(time, sent, parameters)

    def motion(t, x):
        return slope(x, *(np.interp(t, time, values) for values in d.values()))

    x = solve_ivp(motion, time[[0, -1]], level(trim[0]), "RK45", time, max_step=0.02, rtol=1e-6).y
    states = {f"state/{n}": row for n, row in zip(("u", "w", "q", "theta"), x, strict=True)}
    moved = {f"effector/{n}": y for n, y in d.items()}
    return states | moved | {f"command/{n}": y for n, y in command.items()}


def write_flights(folder, effect=EFFECT, seed=0):
    """Write three flights of one airplane as records: two to diagnose, one to hold out."""
    import freqid as fq
    from freqid.core.vehicle import Effector, Inertia, MassProperties

    rng, time = np.random.default_rng(seed), 0.02 * np.arange(3001)
    truth = {name: sigma * rng.standard_normal() for name, sigma in SIGMA.items()}
    body = MassProperties(mass_kg=MASS, inertia=Inertia(xx=1.0, yy=IYY, zz=2.2))
    stops = (("elevator", "surface", (-0.4, 0.4)), ("throttle", "throttle", (0.0, 1.0)))
    effectors = tuple(Effector(name=n, kind=kind, limits=limits) for n, kind, limits in stops)
    size = {"area_m2": AREA, "chord_m": CHORD}
    vehicle = fq.Vehicle(name="small airplane", mass_properties=body, effectors=effectors, **size)
    for number in (1, 2, 3):
        injected = {}
        for first, name, rms in ((3, "elevator", 0.04), (4, "throttle", 0.08)):
            hz = np.arange(first, 108, 2)[:, None] / 60  # lines of its own
            tones = np.sin(2 * np.pi * (hz * time + rng.uniform(size=hz.shape)))
            injected[name] = rms * np.sqrt(2 / hz.size) * tones.sum(axis=0)
        flown = flight(time, injected, truth, effect)
        by_name = {n.partition("/")[2]: x for n, x in flown.items() if not n.startswith("command")}
        load = wrench(time, by_name, by_name, {}, truth)
        flown |= {"state/ax": load["X"] / MASS, "state/az": load["Z"] / MASS, "air/rho": RHO + 0 * time}
        flown |= {f"state/{n}": 0 * time for n in ("v", "p", "r", "phi", "psi", "ay")}
        logged = {f"excitation/{n}": x for n, x in injected.items()}
        for name, x in flown.items():
            group, _, short = name.partition("/")
            noise = NOISE[short] * rng.standard_normal(x.size) if group in ("state", "effector") else 0.0
            logged[name] = x + noise
        record = fq.FlightRecord.of(time, logged, vehicle, reference="cruise")
        fq.save(record, Path(folder) / f"flight{number}.h5")


if __name__ == "__main__":
    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    write_flights(sys.argv[1])

"""A small airplane with struts and a stall that its simulation may lack, flown in its plane of symmetry.

Truth and simulation are written here; `freqid.gap` makes neither. Struts feel the flow across them alone, and
the stall is Kirchhoff's separated flow, with less induced drag; the library's `extra_drag` is a constant
coefficient along the flow, its `stall` a polynomial beyond an onset.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from freqid.core.channels import si_unit
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.gap.connect.callable import CallableSimulation

G, RHO, MASS, IYY, AREA, CHORD = 9.80665, 1.2, 14.0, 1.7, 0.8, 0.32
DT, CRUISE = 0.04, 26.0
SIGMA = {"lift_slope": 0.03, "drag": 0.03, "thrust": 0.02, "stability": 0.05, "pitch_damping": 0.1}
SIGMA |= {"elevator_power": 0.03}
NOISE = dict.fromkeys("uvw", 0.1) | dict.fromkeys(("p", "q", "r", "phi", "theta", "psi"), 0.002)
NOISE |= dict.fromkeys(("ax", "ay", "az"), 0.05) | {"elevator": 5e-4, "throttle": 2e-3}
SLOTS = (("elevator", "surface", (-0.5, 0.5)), ("throttle", "throttle", (0.0, 1.0)))


def vehicle() -> Vehicle:
    body = MassProperties(mass_kg=MASS, inertia=Inertia(xx=1.1, yy=IYY, zz=2.6))
    effectors = tuple(Effector(name=n, kind=kind, limits=limits) for n, kind, limits in SLOTS)
    return Vehicle(name="draggy", mass_properties=body, effectors=effectors, area_m2=AREA, chord_m=CHORD)


def wrench(state, effector, off, attached=lambda alpha: 1.0, drag=1.0, struts=0.0):
    """Return X Z M, N and N m; `off` are shares by which parameters depart, `attached` what lift is left."""
    u, w, k = state["u"], state["w"], {n: 1 + off.get(n, 0.0) for n in SIGMA}
    speed, alpha = np.hypot(u, w), np.arctan2(w, u)
    qs, rate = 0.5 * RHO * speed**2 * AREA, state["q"] * CHORD / (2 * speed)
    cl = 5.0 * k["lift_slope"] * attached(alpha) * (alpha + 0.05)
    cd = drag * k["drag"] * (0.08 + 0.09 * cl**2)
    lift, draw = qs * (cl + 5.0 * rate + 0.4 * effector["elevator"]), qs * cd
    cm = 0.03 - 0.7 * k["stability"] * alpha - 12 * k["pitch_damping"] * rate
    cm = cm - 1.1 * k["elevator_power"] * effector["elevator"]
    thrust = 120 * k["thrust"] * effector["throttle"] * (1 - speed / 60)
    return {
        "X": lift * np.sin(alpha) - draw * np.cos(alpha) + thrust - 0.5 * RHO * struts * u * np.abs(u),
        "Z": -lift * np.cos(alpha) - draw * np.sin(alpha),
        "M": qs * CHORD * cm,
    }


def kirchhoff(alpha):
    """Return the share of the lift that is left where the flow separates about 0.26 rad."""
    point = 0.5 * (1 - np.tanh(18 * (alpha - 0.26)))
    return ((1 + np.sqrt(point)) / 2) ** 2


def simulation(drag: float = 1.0, *, tolerances: bool = True, flies: bool = True) -> CallableSimulation:
    def model(time, state, effector, air, parameters):
        return wrench(state, effector, parameters, drag=drag)

    model.responses = ("X", "Z", "M")
    if tolerances:
        model.tolerances = {n: (s, "1") for n, s in SIGMA.items()}
    if flies:
        model.fly = lambda record, parameters: flown(record.time, injected(record), parameters, drag=drag)
    return CallableSimulation(model, "draggy.py:model", model.responses)


def injected(record):
    excited = {n: record[f"excitation/{n}"] for n, *_ in SLOTS}
    return lambda t, x: [np.interp(t, record.time, s) for s in excited.values()]


def trimmed(speed, off, **truth):
    def left(y):
        state = {"u": speed * np.cos(y[0]), "w": speed * np.sin(y[0]), "q": 0.0}
        f = wrench(state, dict(zip(("elevator", "throttle"), y[1:], strict=True)), off, **truth)
        return [f["X"] / MASS - G * np.sin(y[0]), f["Z"] / MASS + G * np.cos(y[0]), f["M"]]

    return root(left, [0.1, 0.0, 0.4]).x


def flown(time, added: Callable, off, speed=CRUISE, **truth):
    """Return channels of a flight from trim, `added(t, state)` on top of the trimmed effectors."""
    angle, *rest = trimmed(speed, off, **truth)

    def effectors(t, x):
        return {n: r + a for (n, *_), r, a in zip(SLOTS, rest, added(t, x), strict=True)}

    def slope(t, x):
        f = wrench(dict(zip("uwq", x, strict=False)), effectors(t, x), off, **truth)
        ax, az = f["X"] / MASS - G * np.sin(x[3]), f["Z"] / MASS + G * np.cos(x[3])
        return [ax - x[2] * x[1], az + x[2] * x[0], f["M"] / IYY, x[2], x[3] - np.arctan2(x[1], x[0])]

    start = [speed * np.cos(angle), speed * np.sin(angle), 0.0, angle, 0.0]
    x = solve_ivp(slope, time[[0, -1]], start, "RK45", time, max_step=DT, rtol=1e-6).y
    d = effectors(time, x)
    f = wrench(dict(zip("uwq", x, strict=False)), d, off, **truth)
    found = {f"state/{n}": row for n, row in zip(("u", "w", "q", "theta"), x, strict=False)}
    found |= {"state/ax": f["X"] / MASS, "state/az": f["Z"] / MASS}
    return found | {f"effector/{n}": y for n, y in d.items()}


def logged(time, found, seed, reference, more=None, loud=1.0) -> Maneuver:
    rng = np.random.default_rng([seed, 7])
    found = found | {f"state/{n}": 0 * time for n in ("v", "p", "r", "phi", "psi", "ay")}
    found = found | {"air/rho": RHO + 0 * time} | (more or {})
    channels = {}
    for name, x in found.items():
        short = name.partition("/")[2]
        noisy = name.startswith(("state/", "effector/"))
        values = x + (loud * NOISE[short] * rng.standard_normal(time.size) if noisy else 0.0)
        channels[name] = Channel(
            name, si_unit(name) or {"elevator": "rad"}.get(short, "1"), values, 1 / DT, "here"
        )
    return Maneuver(FlightRecord(time, channels, vehicle(), reference=reference), vehicle())


def scatter(seed: int) -> dict[str, float]:
    rng = np.random.default_rng([seed, 1])
    return {n: s * rng.standard_normal() for n, s in SIGMA.items()}


def cruise(seed, off, duration=40.0, **truth) -> Maneuver:
    rng, time = np.random.default_rng([seed, 3]), DT * np.arange(round(duration / DT) + 1)
    signals = {}
    for first, (name, *_), rms in zip((2, 3), SLOTS, (0.03, 0.05), strict=True):
        k = np.arange(first, 1.8 * duration, 3)[:, None]
        tones = np.sin(2 * np.pi * (k / duration * time + rng.uniform(size=k.shape)))
        signals[f"excitation/{name}"] = rms * np.sqrt(2 / k.size) * tones.sum(axis=0)

    def added(t, x):
        return [np.interp(t, time, s) for s in signals.values()]

    return logged(time, flown(time, added, off, **truth), seed, f"r{seed}", signals)


def slowing(seed, off, attached=kirchhoff, duration=60.0, slowest=15.5, loud=2.0, **truth) -> Maneuver:
    """Return a level flight that loses speed slowly and gains it again; nothing is injected.

    The pilot holds height with the elevator and speed with the throttle.
    """
    time, fast = DT * np.arange(round(duration / DT) + 1), 24.0

    def added(t, x):
        speed = np.interp(t / duration, (0.05, 0.6, 1.0), (fast, slowest, 20.0))
        gamma = x[3] - np.arctan2(x[1], x[0])
        return [1.0 * gamma + 0.5 * x[4] + 0.1 * x[2], 0.1 * (speed - np.hypot(x[0], x[1]))]

    return logged(
        time, flown(time, added, off, fast, attached=attached, **truth), seed, f"r{seed}", loud=loud
    )

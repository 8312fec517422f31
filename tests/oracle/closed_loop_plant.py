"""An unstable plant with two inputs under state feedback, sampled, with its exact responses written down."""

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.design.classic import frequency_sweep

DT, PERIOD = 0.05, 40.0
A = np.array([[0.25, 1.0, 0.0], [1.5, -0.9, 0.6], [0.0, -0.7, -1.4]])
B = np.array([[0.2, 1.1], [2.0, -0.4], [0.3, 0.9]])
INPUTS, OUTPUTS = ("de1", "de2"), ("u", "w", "q")
COMBS = (np.arange(2, 61, 2), np.arange(3, 61, 2))
VEHICLE = Vehicle(
    name="plant", mass_properties=MassProperties(mass_kg=1.0, inertia=Inertia(xx=1, yy=1, zz=1))
)

_whole = expm(DT * np.block([[A, B], [np.zeros((2, 5))]]))
F, H = _whole[:3, :3], _whole[:3, 3:]
_P = solve_discrete_are(F, H, np.diag([0.3, 0.3, 0.3]), np.eye(2))
K = np.linalg.solve(np.eye(2) + H.T @ _P @ H, H.T @ _P @ F)


def response(f):
    """Return the exact responses of the three states to the two inputs, shape (3, 2, M)."""
    z = np.exp(2j * np.pi * np.asarray(f) * DT)
    return np.stack([np.linalg.solve(one * np.eye(3) - F, H) for one in z], axis=-1)


def injected(amplitude, seed=0, periods=2):
    rng = np.random.default_rng(seed)
    time = DT * np.arange(round(periods * PERIOD / DT) + 1)
    rows = []
    for comb in COMBS:
        phase = rng.uniform(0, 2 * np.pi, comb.size)
        rows.append(np.sin(2 * np.pi * comb[:, None] * time / PERIOD + phase[:, None]).sum(axis=0))
    return time, amplitude * np.array(rows) / np.sqrt(COMBS[0].size / 2)


def fly(amplitude=1.0, gust=0.0, sensor=0.0, seed=0, periods=2, state=(0.0, 0.0, 0.0)):
    """Fly in closed loop: the law acts on noisy measurements, gusts push the states."""
    rng = np.random.default_rng([seed, 7])
    time, r = injected(amplitude, periods=periods)
    v = sensor * rng.standard_normal((3, time.size))
    w = gust * np.sqrt(DT) * rng.standard_normal((3, time.size))
    states, inputs = _held(r, np.array(state), v, w)
    return _logged(time, states, inputs, r)


BAND = (0.04, 1.2)
"""Of the sweeps, Hz."""


def fly_sweeps(spacing="logarithmic", gust=0.0, sensor=0.0, seed=0, duration=120.0, rest=8.0, both=True):
    """Fly both inputs' sweeps one after the other, or the first alone, at rest before, between and after.

    ``state/psi`` integrates q and nothing holds it.
    """
    rng = np.random.default_rng([seed, 8])
    one = frequency_sweep(BAND, duration, DT, fade_s=2.0, spacing=spacing)
    still = np.zeros(round(rest / DT))
    empty = np.zeros(one.size + still.size)
    r = np.array([np.concatenate([still, one, still, empty]), np.concatenate([still, empty, one, still])])
    if not both:
        r = np.array([[*still, *one, *still], np.zeros(one.size + 2 * still.size)])
    v = sensor * rng.standard_normal((3, r.shape[1]))
    w = gust * np.sqrt(DT) * rng.standard_normal((3, r.shape[1]))
    states, inputs = _held(r, np.zeros(3), v, w)
    return _logged(DT * np.arange(r.shape[1]), states, inputs, r)


def swept_response(f):
    """Return the exact responses of u w q psi to the two inputs, shape (4, 2, M)."""
    found = response(f)
    return np.concatenate([found, DT / (np.exp(2j * np.pi * np.asarray(f) * DT) - 1) * found[2:]])


def one_response(f):
    """Return the responses of u w q to the first input, (3, M), the loop of the second one closed."""
    closed = F - H[:, 1:] @ K[1:]
    z = np.exp(2j * np.pi * np.asarray(f) * DT)
    return np.stack([np.linalg.solve(each * np.eye(3) - closed, H[:, 0]) for each in z], axis=-1)


def _held(r, x, v, w):
    """Return what sensors say of the states, and the inputs that the law and the signals make."""
    states, inputs = np.empty((3, r.shape[1])), np.empty(r.shape)
    for i in range(r.shape[1]):
        states[:, i] = x + v[:, i]
        inputs[:, i] = r[:, i] - K @ states[:, i]
        x = F @ x + H @ inputs[:, i] + w[:, i]
    return states, inputs


def _logged(time, states, inputs, r):
    channels = {}
    heading = DT * np.concatenate([[0.0], np.cumsum(states[2])[:-1]])
    channels["state/psi"] = Channel("state/psi", "rad", heading, 1 / DT, "plant")
    units = {"u": "m/s", "w": "m/s", "q": "rad/s"}
    for name, row in zip(OUTPUTS, states, strict=True):
        channels[f"state/{name}"] = Channel(f"state/{name}", units[name], row, 1 / DT, "plant")
    for name, row, signal in zip(INPUTS, inputs, r, strict=True):
        channels[f"effector/{name}"] = Channel(f"effector/{name}", "rad", row, 1 / DT, "plant")
        channels[f"excitation/{name}"] = Channel(f"excitation/{name}", "rad", signal, 1 / DT, "plant")
    return Maneuver(FlightRecord(time, channels, VEHICLE), VEHICLE)

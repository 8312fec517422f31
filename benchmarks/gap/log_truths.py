"""Truths that are made of the log: sensors of either vehicle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from freqid.core.record import FlightRecord


def _filtered(values: np.ndarray, dt: float, response: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return a signal through a linear filter, mirrored at its ends; its trend as the filter lets it pass."""
    trend = np.linspace(values[0], values[-1], values.size)
    inside = values - trend
    whole = np.concatenate([inside, -inside[::-1]])
    s = 2j * np.pi * np.fft.rfftfreq(whole.size, dt)
    passed = np.fft.irfft(np.fft.rfft(whole) * response(s), whole.size)[: values.size]
    return passed + trend * np.real(response(np.zeros(1)))


def _pade(delay: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda s: (1 - s * delay / 2) / (1 + s * delay / 2)


SKEWED = {
    "velocity": ("state/u", "state/v", "state/w", "air/V", "air/alpha", "air/beta"),
    "rates": ("state/p", "state/q", "state/r"),
    "accelerometers": ("state/ax", "state/ay", "state/az"),
    "attitude": ("state/phi", "state/theta", "state/psi"),
}


def skewed(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Sensors behind a first-order Pade form, their digits coarse."""
    names = SKEWED.get(place) or tuple(f"effector/{n}" for n in record.group("effector"))
    late = []
    for name in (n for n in names if n in record):
        values = _filtered(np.unwrap(record[name]) if "psi" in name else record[name], record.dt, _pade(size))
        late.append(replace(record.channel(name), values=values))
    return record.with_channels(*late)


def bending(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log with a mode of 4 Hz, well damped, that the gyro feels with another share."""
    del place
    w, damping = 2 * np.pi * 4.0, 0.05

    def response(s: np.ndarray) -> np.ndarray:
        return s**2 / (s**2 + 2 * damping * w * s + w**2)

    force = record["state/az"] - record["state/az"].mean()
    bent = _filtered(force, record.dt, response)
    turned = _filtered(
        force, record.dt, lambda s: s * response(np.where(s == 0, 1.0, s)) / np.where(s == 0, 1, s) ** 2
    )
    az, q = record.channel("state/az"), record.channel("state/q")
    return record.with_channels(
        replace(az, values=az.values - size * bent), replace(q, values=q.values + 0.8 * size * turned)
    )


def compressed(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log of a sensor that reads too much about its mean, less so far from it."""
    kinds = record.vehicle.effector_kinds if record.vehicle else {}
    names = (
        tuple(f"effector/{n}" for n in record.group("effector") if kinds.get(n) == place)
        if place == "surface"
        else (f"state/{place}",)
    )
    found = []
    for name in names:
        x = record[name]
        moved = x - x.mean()
        wide = 3 * moved.std()
        found.append(
            replace(record.channel(name), values=x + size * (x.mean() + wide * np.tanh(moved / wide)))
        )
    return record.with_channels(*found)


def shaken_gyro(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log of a gyro that answers to acceleration."""
    q = record.channel("state/q")
    ax = record["state/ax"] - record["state/ax"].mean()
    az = record["state/az"] - record["state/az"].mean()
    del place
    return record.with_channels(replace(q, values=q.values + size * (az + 0.5 * ax)))


def hysteresis(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Potentiometers that stick: what they read lags behind by up to the size, rad, in each direction."""
    del place
    kinds = record.vehicle.effector_kinds if record.vehicle else {}
    found = []
    for name in (n for n in record.group("effector") if kinds.get(n) == "surface"):
        channel = record.channel(f"effector/{name}")
        state, values = 0.0, channel.values.copy()
        steps = np.diff(channel.values, prepend=channel.values[0])
        for i, step in enumerate(steps.tolist()):
            state += step - abs(step) * state / max(size, 1e-9)
            values[i] -= state
        found.append(replace(channel, values=values))
    return record.with_channels(*found)

"""The attitude and the specific force that go with a motion, where a model gives its velocities and rates."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.arrays import Array
from freqid.core.channels import ATTITUDE, FORCES, RATES, VELOCITY
from freqid.core.record import FlightRecord
from freqid.dynamics.frames import cross
from freqid.gap.stack.rows import angle_rates, gravity_of, sensor_lever

_SMALL = 1e-3  # share of an attitude's motion over which gravity is differentiated


def with_attitude_and_felt(
    record: FlightRecord, moved: dict[str, Array], *, linear: bool = False
) -> dict[str, Array]:
    """Return channels with the attitude and the specific force that go with a motion, where they lack.

    Parameters
    ----------
    record : FlightRecord
        What is measured, and where its accelerometers are.
    moved : dict of ndarray, shape (sample,)
        Motion and effectors, by channel.
    linear : bool
        Whether both are of first order, as a motion is whose velocity never answered to the products of
        rates and velocities that the full equations of motion hold.
    """
    attitude = [n for n in ATTITUDE if n in record]
    if not all(n in moved for n in RATES) or not {"state/phi", "state/theta"} <= set(attitude):
        return moved
    # splines: differences of samples 0.02 s apart take 1 % off at 2 Hz, and sums half of that
    found, at = dict(moved), record.dt * np.arange(record.time.size)
    rates = np.array([moved[n] for n in RATES])
    lacking = [n for n in attitude if n not in moved]
    if lacking:
        phi, theta = (record[n].mean() if linear else record[n] for n in ("state/phi", "state/theta"))
        slopes = angle_rates(rates, phi, theta)
        time = record.time - record.time.mean()
        for path in lacking:
            angle = CubicSpline(at, slopes[path.partition("/")[2]]).antiderivative()(at)
            found[path] = (
                np.unwrap(record[path]).mean() + angle - np.polyval(np.polyfit(time, angle, 1), time)
            )
    if any(n in record and n not in moved for n in FORCES) and all(n in moved for n in VELOCITY):
        lever = np.broadcast_to(sensor_lever(record), rates.shape)
        level = np.array([record[n].mean() - moved[n].mean() for n in VELOCITY])[:, None]
        velocity = np.array([moved[n] for n in VELOCITY]) + level + cross(rates, lever)
        slope, gravity = CubicSpline(at, velocity, axis=1)(at, 1), _gravity(found, linear=linear)
        if linear:
            velocity = np.broadcast_to(velocity.mean(axis=1, keepdims=True), rates.shape)
        felt = slope + cross(rates, velocity) - gravity
        found |= {n: x for n, x in zip(FORCES, felt, strict=True) if n in record and n not in moved}
    return found


def _gravity(channels: Mapping[str, Array], *, linear: bool) -> Array:
    """Return gravity in body axes, m/s2, shape (3, sample); to first order about the mean attitude."""
    phi, theta = channels["state/phi"], channels["state/theta"]
    if not linear:
        return gravity_of(phi, theta)
    up, down = (
        gravity_of(*(x.mean() + step * (x - x.mean()) for x in (phi, theta))) for step in (_SMALL, -_SMALL)
    )
    return (up + down) / 2 + (up - down) / (2 * _SMALL)

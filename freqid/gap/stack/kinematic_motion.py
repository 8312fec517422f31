"""A model's flight with what a record tells of the body's six motions, by the kinematics of its channels.

Where an effect is so large that the aircraft flies otherwise, polynomials in frequency leave several per cent
of the rates. On each line the three velocities and the three rates are six numbers, and velocities, gyros,
accelerometers and attitude measure them eleven times: so they are told from one line alone. Effectors are
told by their own sensors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from freqid.core.arrays import Array, Complex
from freqid.core.channels import ATTITUDE, FLOW, FORCES, RATES, VELOCITY
from freqid.core.record import FlightRecord
from freqid.dynamics.frames import cross
from freqid.gap.stack.felt import with_attitude_and_felt
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.missed_motion import history, parted, with_missed
from freqid.gap.stack.rows import angle_rates, gravity_of, sensor_lever

_BODY = (*VELOCITY, *RATES)
_TILTS = ("state/phi", "state/theta")  # a heading ends elsewhere than it began: on all lines it has that too
_ROUNDS = 2  # kinematics are straight about the last motion, and their products move other lines
_SENSOR = 0.01  # of a channel: what its sensor may say otherwise than the motion
_NOISE_LINES = 31  # over which the noise of repeats is averaged
_NEIGHBOURS = 15  # lines whose power is averaged
_LEAST = 1e-30  # variance of a channel that neither moves nor has noise
_STEP = 1e-3  # rad, over which gravity is differentiated


def noise_of(records: Sequence[FlightRecord], lines: Lines, sigma: Mapping[str, float]) -> dict[str, Array]:
    """Return the noise power of one of several repeats, shape (line,), by channel of the motion.

    As white as its sensors' noise, or as repeats differ where that is more: in gusts it is.

    Parameters
    ----------
    records : sequence of FlightRecord
    lines : Lines
    sigma : dict of float
        Standard deviation of white noise by channel.
    """
    effectors = [f"effector/{n}" for n in records[0].group("effector")]
    every = (*VELOCITY, *RATES, *ATTITUDE, *FORCES, *effectors)
    names = [n for n in every if n in sigma and all(n in r for r in records)]
    white = lines.dt * np.array([sigma[n] for n in names])[:, None] ** 2
    power = np.repeat(white, lines.hz.size, axis=1)
    if len(records) > 1:
        values = np.array([[np.unwrap(r[n]) if n in ATTITUDE else r[n] for n in names] for r in records])
        apart = np.abs(lines.spectrum(values - values.mean(axis=0))) ** 2
        apart = apart.sum(axis=0) / (len(records) - 1)
        near = min(_NOISE_LINES, lines.hz.size - 1)
        apart[:, 1:] = uniform_filter1d(apart[:, 1:], near, axis=1, mode="nearest")  # zero: records' offsets
        power = np.maximum(power, apart)
    return dict(zip(names, power, strict=True))


def moved_as_recorded(
    record: FlightRecord, own: Mapping[str, Array], lines: Lines, noise: Mapping[str, Array]
) -> dict[str, Array]:
    """Return channels that move, on driven lines, as the six motions of a record do.

    First what changes slowly with frequency (`with_missed`), as far as one motion makes it in all channels;
    then, of what is left, each of the six as far as the power of neighbouring lines is more than its
    variance (empirical Bayes: C. N. Morris, JASA 78, 1983). Each line's own noise is in it, so it is motion
    for other records than this one.

    Parameters
    ----------
    record : FlightRecord
    own : dict of ndarray, shape (sample,)
        The model's, by channel.
    lines : Lines
    noise : dict of ndarray, shape (line,)
        Of the record's channels: power, as spectra of `lines`.

    Returns
    -------
    dict of ndarray, shape (sample,)
    """
    if not lines.driven.any() or not all(n in own and n in noise for n in _BODY):
        return dict(own)
    found = {n: x for n, x in own.items() if n not in FLOW}  # it follows from the velocity
    for _ in range(_ROUNDS):
        body = np.array([found[n] for n in _BODY]) + _body_beyond(record, found, lines, noise)
        moved = with_attitude_and_felt(record, dict(zip(_BODY, body, strict=True)))
        found |= {n: x for n, x in moved.items() if n in own}
    return found | _effectors(record, found, lines, noise)


def _effectors(
    record: FlightRecord, own: Mapping[str, Array], lines: Lines, noise: Mapping[str, Array]
) -> dict[str, Array]:
    """Return effectors with what a record has beyond a model's on driven lines, as far as it is not noise."""
    names = [n for n in own if n.startswith("effector/") and n in noise]
    if not names:
        return {}
    at = np.flatnonzero(lines.driven)
    modelled, rest = parted(record, own, names)
    left = lines.spectrum(rest)[:, at]
    power = np.maximum(_near(np.abs(left) ** 2), _LEAST)
    found = np.zeros((len(names), lines.hz.size), dtype=np.complex128)
    found[:, at] = left * np.maximum(1 - np.array([noise[n][at] for n in names]) / power, 0.0)
    return dict(zip(names, modelled + history(found, lines, record.time.size), strict=True))


def _body_beyond(
    record: FlightRecord, own: Mapping[str, Array], lines: Lines, noise: Mapping[str, Array]
) -> Array:
    """Return what the six motions of a record have beyond a model's, shape (6, sample)."""
    at = np.flatnonzero(lines.driven)
    by_motion = _by_motion(record, lines.hz[at])
    names = [n for n in by_motion if n in noise and n in own]
    made = np.stack([by_motion[n] for n in names], axis=1)  # (line, channel, motion)
    modelled, rest = parted(record, own, names)
    smooth = with_missed(record, {n: own[n] for n in names}, lines)
    slowly, left = (lines.spectrum(x)[:, at] for x in (np.array([smooth[n] for n in names]) - modelled, rest))
    power = _near(np.abs(lines.spectrum(modelled + rest)[:, at]) ** 2)
    variance = np.maximum(np.array([noise[n][at] for n in names]) + _SENSOR**2 * power, _LEAST)
    weighed = made.conj().swapaxes(1, 2) / variance.T[:, None]  # (line, motion, channel)
    known = weighed @ made
    moved = np.linalg.solve(known, weighed @ slowly.T[..., None])
    beyond = weighed @ (left.T[..., None] - made @ moved)
    each, error = np.linalg.solve(known, beyond)[..., 0], np.einsum("lii->li", np.linalg.inv(known)).real
    prior = np.maximum(_near(np.abs(each.T) ** 2).T - error, 0.0)
    root = np.sqrt(prior)[..., None]  # (line, motion, 1)
    inside = np.eye(6) + root * known * root.swapaxes(1, 2)
    moved = moved + root * np.linalg.solve(inside, root * beyond)
    found = np.zeros((6, lines.hz.size), dtype=np.complex128)
    found[:, at] = moved[..., 0].T
    return history(found, lines, record.time.size)


def _by_motion(record: FlightRecord, hz: Array) -> dict[str, Complex]:
    """Return what velocities and rates, small and about the record's mean, make of its channels.

    Shape (line, 6) each: by u v w where velocity is measured, then p q r.
    """
    s = np.asarray(2j * np.pi * hz[:, None, None], dtype=np.complex128)
    nothing, each = np.zeros((3, 3)), np.eye(3)
    rows: dict[str, Complex] = {}

    def add(of: Sequence[str], by_velocity: Complex | Array, by_rates: Complex | Array) -> None:
        parts = [np.broadcast_to(x, (hz.size, len(of), 3)) for x in (by_velocity, by_rates)]
        rows.update(zip(of, np.concatenate(parts, axis=2).swapaxes(0, 1), strict=True))

    add(VELOCITY, each, nothing)
    add(RATES, nothing, each)
    if "state/phi" in record and "state/theta" in record:
        phi, theta = (record[n].mean(keepdims=True) for n in ("state/phi", "state/theta"))
        slopes = angle_rates(each, phi, theta)
        angles = np.array([slopes[n.partition("/")[2]] for n in ATTITUDE]) / s
        add(_TILTS, nothing[:2], angles[:, :2])
        if all(n in record for n in FORCES):
            ends = [
                gravity_of(phi + a, theta + b) - gravity_of(phi - a, theta - b)
                for a, b in ((_STEP, 0.0), (0.0, _STEP))
            ]
            gravity = np.concatenate(ends, axis=1) / (2 * _STEP)  # (3, 2): by phi, by theta
            level = np.array([record[n].mean() for n in VELOCITY])[:, None]
            turned = [cross(each, np.broadcast_to(x, (3, 3))) for x in (sensor_lever(record), level)]
            felt = np.asarray(s * turned[0] + turned[1] - gravity @ angles[:, [0, 1]], dtype=np.complex128)
            add(FORCES, np.asarray(s * each, dtype=np.complex128), felt)
    return {n: row for n, row in rows.items() if n in record}


def _near(power: Array) -> Array:
    """Return the mean power of neighbouring lines, shape (channel, line)."""
    return uniform_filter1d(power, min(_NEIGHBOURS, power.shape[1]), axis=1, mode="nearest")

"""One condition of the stack: repeats of a manoeuvre, their mean residual, its noise, the motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.departed import Departed
from freqid.gap.simulation import Departures, Settings, Simulation, side_by_side
from freqid.gap.stack.histories import Histories, Row
from freqid.gap.stack.kinematic_motion import noise_of
from freqid.gap.stack.lines import Lines, lines_of, thinning
from freqid.gap.stack.missed_motion import as_far_as_seen, share_missed
from freqid.gap.stack.motion import OWN_FLIGHT, Motion, noise_free
from freqid.gap.stack.noise import (
    Draws,
    antithetic,
    beyond_motion,
    covariance_of,
    flown_covariance,
    least_power,
    sensor_power,
    smooth_ratio,
    whitening_of,
)
from freqid.gap.stack.sensor_noise import noisy_channels, sensor_noise
from freqid.gap.stack.trial import Trial

REPEATS = "repeats of the manoeuvre"
_FEW_LINES = 5  # that nothing drives, in a half of the driven band: up to these tell nothing of its noise
_EMPTY = 1e-6  # of the largest: a singular value that is none


@dataclass(frozen=True, eq=False)
class Block:
    """One condition.

    Attributes
    ----------
    names : tuple of str
        Records that are repeats of each other.
    maneuvers : tuple of Maneuver
    lines : Lines
    motion : Motion
        Without noise, about the mean of the records.
    trial : Trial
        Of that motion.
    sigma : dict of float
        Standard deviation of white noise by channel.
    draws : Draws
    residuals : ndarray of complex, shape (record, row, line)
        Measured less simulated, less the bias of replays on noisy states.
    covariance : ndarray of complex, shape (line, row, row)
        Of the mean residual's noise.
    noise_from : str
        What the noise was learned from.
    plain : Trial
        Of the motion, with the simulation as it is: no parameter departs and no effect acts.
    as_logged : Trial
        The same on the motion with what the records say beyond it.
    as_moved : Trial, optional
        On the same motion without what sensors made of it, and on the simulation as it is likeliest, once
        both were asked of the data.
    """

    names: tuple[str, ...]
    maneuvers: tuple[Maneuver, ...]
    lines: Lines
    motion: Motion
    trial: Trial
    sigma: dict[str, float]
    draws: Draws
    residuals: Complex
    covariance: Complex
    noise_from: str
    plain: Trial
    as_logged: Trial
    as_moved: Trial | None = None

    @property
    def drawn(self) -> Trial:
        """The trial on which columns are drawn, all of them on the same one."""
        return self.as_moved or self.trial

    @property
    def rows(self) -> tuple[Row, ...]:
        """Of the stack."""
        return self.trial.measured.rows

    @property
    def regime(self) -> str:
        """Reference condition, else the first record's name."""
        return self.maneuvers[0].record.reference or self.names[0]

    @cached_property
    def grid(self) -> Lines:
        """The same lines on the samples of the motion without noise, which may be fewer."""
        samples = self.trial.maneuver.record.time.size
        if samples == self.lines.samples:
            return self.lines
        return self.lines.thinned((self.lines.samples - 1) // (samples - 1))

    @cached_property
    def residual(self) -> Complex:
        """Mean over the repeats, shape (row, line)."""
        return self.residuals.mean(axis=0)

    @cached_property
    def whitening(self) -> Complex:
        """W with ``W covariance W^H = 1``, shape (line, row, row)."""
        return whitening_of(self.covariance)

    @property
    def noise_power(self) -> Array:
        """Diagonal of the covariance, shape (row, line)."""
        return np.einsum("lii->il", self.covariance).real

    @cached_property
    def power_alone(self) -> Array:
        """Power of the noise of each row where that of all others is known, shape (row, line)."""
        return 1 / np.einsum("lii->il", np.linalg.inv(self.covariance)).real

    def white(self, z: Complex, rows: Sequence[int] | None = None) -> Array:
        """Return rows on lines, shape (..., row, line), as independent real numbers of variance one.

        Parameters
        ----------
        z : ndarray of complex, shape (..., row, line)
        rows : sequence of int, optional
            Of these alone; of all where absent.
        """
        whitening = self.whitening
        if rows is not None:
            whitening = whitening_of(self.covariance[:, rows][:, :, rows])
            z = z[..., rows, :]
        # one matrix product a line
        found = np.moveaxis(
            whitening @ np.moveaxis(z.reshape(-1, *z.shape[-2:]), (0, 2), (2, 0)), (0, 2), (2, 0)
        )
        found = found.reshape(z.shape)
        real = self.lines.real(found)
        return real.reshape(*real.shape[:-2], real.shape[-2] * real.shape[-1])

    def without_first(self) -> Block:
        """Return the block of all its repeats but the first."""
        count = len(self.maneuvers)
        return replace(
            self,
            names=self.names[1:],
            maneuvers=self.maneuvers[1:],
            residuals=self.residuals[1:],
            covariance=self.covariance * (count / (count - 1)),
        )

    def transform(self, histories: Histories) -> Complex:
        """Return histories of the motion without noise on the lines, shape (row, line)."""
        return self.grid.transform(histories)


def stack_of(
    simulation: Simulation,
    maneuvers: Sequence[Maneuver],
    names: Sequence[str],
    band_hz: tuple[float, float],
    *,
    seed: int = 0,
    departures: Departures | None = None,
    effects: Settings | None = None,
    acting: Settings | None = None,
) -> list[Block]:
    """Return the stack of some records: one block for each condition, repeats together.

    Parameters
    ----------
    simulation : Simulation
    maneuvers : sequence of Maneuver
    names : sequence of str
        Of the records, for messages.
    band_hz : tuple of 2 floats
    seed : int
        Of the noise that is sent through the pipeline.
    departures : dict of float, optional
        Of the simulation's own parameters, with which it flies the motion without noise.
    effects, acting : dict of dict of float, optional
        Of the simulation itself: those with which it flies too, and those beside which changes are asked.

    Raises
    ------
    DataError
        Where a record lacks what the simulation needs, or its noise cannot be told.
    """
    groups: list[list[int]] = []
    for i, m in enumerate(maneuvers):
        like = next((g for g in groups if _repeats(maneuvers[g[0]].record, m.record)), None)
        groups.append([i]) if like is None else like.append(i)

    def block(k: int) -> Block:
        flown, called = [maneuvers[i] for i in groups[k]], [names[i] for i in groups[k]]
        block = _block(simulation, flown, called, band_hz, seed + 1000 * k, departures)
        return flown_again(block, departures or {}, effects, acting) if effects else block

    return side_by_side(simulation, block, range(len(groups)))


def flown_again(
    block: Block,
    departures: Departures,
    effects: Settings | None = None,
    acting: Settings | None = None,
    *,
    seen: bool = False,
) -> Block:
    """Return a block on the motion that a simulation with departures of its own parameters flies.

    What was measured stays as it is, and so does its noise. Changes are asked of the simulation with these
    departures.

    Parameters
    ----------
    block : Block
    departures : dict of float
    effects : dict of dict of float, optional
        Of the simulation itself, with which it flies too, where it can.
    acting : dict of dict of float, optional
        Those of them beside which changes are asked for.
    seen : bool
        Whether the body moves as the first of several repeats tells of each line (`moved_as_recorded`). Only
        the others are compared then: no noise may be in both.
    """
    several = seen and len(block.maneuvers) > 1
    simulation = block.trial.simulation
    if isinstance(simulation, Departed):
        simulation = simulation.nominal
    lines, commands = block.lines, block.motion.commands
    noise = noise_of([m.record for m in block.maneuvers], lines, block.sigma) if several else None
    telling = block.maneuvers[0] if several else _mean_of(block.maneuvers)
    motion = noise_free(simulation, telling, lines, departures, effects, commands, noise)
    if effects and motion.source != OWN_FLIGHT:
        motion = noise_free(simulation, telling, lines, departures, None, commands, noise)
    block = block.without_first() if several else block
    mean = _mean_of(block.maneuvers)
    if several:
        moved = {n: c.values for n, c in motion.maneuver.record.channels.items()}
        motion = replace(motion, missed=share_missed(mean.record, moved))
    trial = motion.trial_of(_departed(simulation, departures, acting))
    logged = _as_logged(simulation, mean, motion, lines, block.sigma, len(block.maneuvers))
    trial, plain = (_thin(t, lines) for t in (trial, motion.trial_of(simulation)))
    return replace(block, motion=motion, trial=trial, plain=plain, as_logged=logged, as_moved=None)


def _departed(
    simulation: Simulation, departures: Departures | None, acting: Settings | None = None
) -> Simulation:
    if not (departures or acting):
        return simulation
    # all else that a simulation has is the nominal one's
    return cast(Simulation, Departed(simulation, departures or {}, acting or {}))


def _as_logged(
    simulation: Simulation,
    mean: Maneuver,
    motion: Motion,
    lines: Lines,
    sigma: Mapping[str, float],
    repeats: int,
) -> Trial:
    """Return a simulation beside the motion with what the mean of so many records says beyond it.

    Where nothing was injected that may be gusts, whose loads are in the residual: shifted or scaled, what
    they moved would copy them. There it stays the motion.
    """
    if not lines.driven.any():
        return _thin(motion.trial_of(simulation), lines)
    flown, logged = motion.maneuver.record, motion.as_commanded(mean)
    moves = [n for n in flown.channels if n in sigma or n.startswith("effector/")]  # others follow from these
    own = {n: flown[n] for n in moves if n in logged.record}
    found = as_far_as_seen(logged.record, own, lines, {n: x / repeats**0.5 for n, x in sigma.items()})
    own = {n: flown[n] for n in flown.channels if n in logged.record and n not in own}
    found |= {n: x for n, x in own.items() if not n.startswith(("command/", "excitation/"))}
    channels = [replace(flown.channel(n), values=x) for n, x in found.items()]
    record = logged.record.with_channels(*channels)
    return _thin(Trial.of(simulation, replace(logged, record=record)), lines)


def _thin(trial: Trial, lines: Lines) -> Trial:
    return trial.thinned(thinning(lines.samples, lines.dt, lines.hz[-1]))


def _repeats(one: FlightRecord, other: FlightRecord) -> bool:
    """Return whether two records hold the same injected signals at the same reference."""
    injected = one.group("excitation")
    if not injected or injected != other.group("excitation") or one.reference != other.reference:
        return False
    if one.time.size != other.time.size or abs(one.dt - other.dt) > 1e-9:
        return False
    return all(
        np.allclose(one[f"excitation/{n}"], other[f"excitation/{n}"], atol=1e-9 + 1e-6 * _size(one, n))
        for n in injected
    )


def _size(record: FlightRecord, name: str) -> float:
    return float(np.abs(record[f"excitation/{name}"]).max())


def _block(
    simulation: Simulation,
    maneuvers: Sequence[Maneuver],
    names: Sequence[str],
    band_hz: tuple[float, float],
    seed: int,
    departures: Departures | None,
) -> Block:
    first = maneuvers[0].record
    lines = lines_of(first, band_hz[1])
    try:
        mean = _mean_of(maneuvers)
        motion = noise_free(simulation, mean, lines, departures)
        trial = motion.trial_of(simulation)
        residuals = []
        for m in map(motion.as_commanded, maneuvers):
            own = Trial.of(simulation, m) if len(maneuvers) > 1 or m is not motion.maneuver else trial
            residuals.append(lines.transform(own.residual))
    except DataError as error:
        raise error.at(names[0]) from None
    sigma = _noise_of(maneuvers)
    draws = antithetic(trial, lines, sigma, seed)  # at the record's own rate: noise is not smooth
    unbiased = np.array(residuals) - draws.bias
    least = least_power(trial, lines)
    if len(maneuvers) > 1:
        sensors, source = covariance_of(draws, np.ones_like(draws.bias_error), least), REPEATS
        covariance = flown_covariance(sensors, _apart(unbiased, trial, lines, sigma, sensors))
    else:
        scale, source = _scale(motion, lines, trial, draws, unbiased[0], least)
        covariance = covariance_of(draws, scale, least)
    covariance = covariance / len(maneuvers)
    if not np.isfinite(covariance).all():
        raise DataError(
            "no noise can be told from its channels",
            where=names[0],
            remedy="give a record whose samples are as the sensors took them, or a second flight of the same",
        )
    plain = _thin(trial, lines)
    return Block(
        tuple(names),
        tuple(maneuvers),
        lines,
        motion,
        _thin(motion.trial_of(_departed(simulation, departures)), lines) if departures else plain,
        sigma,
        draws,
        unbiased,
        covariance,
        source,
        plain,
        _as_logged(simulation, mean, motion, lines, sigma, len(maneuvers)),
    )


def _mean_of(maneuvers: Sequence[Maneuver]) -> Maneuver:
    """Return the mean of repeats, channel by channel."""
    first = maneuvers[0]
    if len(maneuvers) == 1:
        return first
    record = first.record
    shared = [n for n in record.channels if all(n in m.record for m in maneuvers)]
    angles = ("state/phi", "state/psi")
    channels = [
        replace(
            record.channel(n),
            values=np.mean(
                [np.unwrap(m.record[n]) if n in angles else m.record[n] for m in maneuvers], axis=0
            ),
        )
        for n in shared
    ]
    return replace(first, record=record.with_channels(*channels))


def _noise_of(maneuvers: Sequence[Maneuver]) -> dict[str, float]:
    """Return the standard deviation of white noise by channel, root mean square over repeats."""
    each = [sensor_noise(m.record, noisy_channels(m.record)) for m in maneuvers]
    names = [n for n in each[0] if all(n in one for one in each)]
    return {n: float(np.sqrt(np.mean([one[n] ** 2 for one in each]))) for n in names}


def _scale(
    motion: Motion, lines: Lines, trial: Trial, draws: Draws, residual: Complex, least: Array
) -> tuple[Array, str]:
    """Return the ratio of flown noise to the sensors', shape (row, line), and what it was learned from."""
    power = np.maximum(sensor_power(draws), least[:, None])
    left, freedom = beyond_motion(motion.maneuver, lines, trial.measured, residual, power)
    freedom[:, 0] = 0.0  # offsets differ from record to record
    undriven = ~lines.driven
    band = undriven[1 : int(np.max(np.flatnonzero(lines.driven), initial=0))]  # beyond it noise may differ
    if all(half.sum() > _FEW_LINES for half in np.array_split(band, 2)):
        return smooth_ratio(lines.hz, left, freedom * undriven), "lines that nothing drives"
    ratio = smooth_ratio(lines.hz, left, freedom)
    if motion.shares_noise:  # which then seems to be explained
        ratio = np.maximum(ratio, 1.0)
    return ratio, "what no response to the motion explains"


def _apart(
    residuals: Complex, trial: Trial, lines: Lines, sigma: Mapping[str, float], sensors: Complex
) -> Complex:
    """Return differences between records, shape (difference, row, line), each with the noise of one.

    What constant offsets of channels and end values explain is projected out: both differ between records.
    """
    count, rows = residuals.shape[:2]
    contrasts = np.linalg.qr(np.eye(count) - 1 / count)[0][:, : count - 1].T
    record = trial.maneuver.record
    momentum = np.any(trial.measured.momentum, axis=1)
    columns = []
    for name, size in sigma.items():
        channel = record.channel(name)
        moved = record.with_channels(replace(channel, values=channel.values + size))
        columns.append(lines.transform(trial.relogged(moved)))
    for i in range(rows):
        z = np.zeros((2, rows, lines.hz.size), dtype=complex)
        z[0, i, 0] = 1.0
        z[1, i] = momentum[i]
        columns.extend(z)
    root = np.linalg.cholesky(sensors)

    def real(z: Complex) -> Array:
        white = np.moveaxis(np.linalg.solve(root, np.moveaxis(z, (0, 2), (2, 0))), (0, 2), (2, 0))
        return lines.real(np.asarray(white, dtype=np.complex128)).reshape(len(z), -1)

    y = real(np.asarray(np.tensordot(contrasts, residuals, 1), dtype=np.complex128))
    _, size, basis = np.linalg.svd(real(np.array(columns)), full_matrices=False)
    basis = basis[size > _EMPTY * size[0]]
    y = (y - (y @ basis.T) @ basis).reshape(count - 1, rows, -1)
    return np.einsum("lij,kjl->kil", root, lines.complex(y))

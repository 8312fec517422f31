"""The simulation's own flight beside the record's: what an explanation makes of its motion, in closed loop.

An explanation is known by what it adds to loads and positions along the motion that was flown. Added to the
simulation there, it moves the simulated flight by the response of its closed loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.channels import WRENCH
from freqid.core.errors import FreqidError
from freqid.core.record import FlightRecord, Maneuver
from freqid.dynamics.small_motion import STATES
from freqid.gap.close.loop import Loop, feedback_on, law_of, steady_spectra
from freqid.gap.model.replay import Replay
from freqid.gap.model.testable import in_force_of
from freqid.gap.stack.block import Block
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.motion import own_maneuver
from freqid.gap.stack.noise import smooth_ratio
from freqid.gap.stack.sensor_noise import sensor_noise
from freqid.simulate.effects.effect import Effect

_ORDER = 4  # of the polynomial that an actuator's response is
_EMPTY = 1e-6  # of the largest: a singular value that is none
_MOTION = tuple(f"state/{n}" for n in STATES[:6])


class CannotFly(Exception):
    """Why a flight of the simulation tells nothing."""


@dataclass(frozen=True, eq=False)
class OwnFlight:
    """The simulation's nominal flight under the injected signals of one block, and its loop.

    Attributes
    ----------
    block : Block
    record : FlightRecord
        Flown by the simulation, about the straight lines of the measured channels.
    states : tuple of str
        That both have and that move.
    lines : ndarray of int
        Lines that injected signals drive.
    measured, flown : ndarray of complex, shape (state, line)
        On these lines.
    power : ndarray, shape (state, line)
        Of the noise of what was measured.
    loop : Loop
        Of small motions about the flight.
    effectors : tuple of str
    loads : ndarray, shape (6, row)
        N and N m that one unit of each row of the block is.
    """

    block: Block
    record: FlightRecord
    states: tuple[str, ...]
    lines: NDArray[np.intp]
    measured: Complex
    flown: Complex
    power: Array
    loop: Loop
    effectors: tuple[str, ...]
    loads: Array

    @classmethod
    def of(cls, block: Block) -> OwnFlight:
        """Fly the simulation under a block's injected signals.

        Raises
        ------
        CannotFly
            Where it does not fly, nothing was injected, or no loop can be made of the flight.
        """
        simulation = block.trial.nominal.simulation
        if not simulation.can_fly:
            raise CannotFly("the simulation does not fly by itself")
        driven = np.flatnonzero(block.lines.driven)
        if not driven.size:
            raise CannotFly("nothing was injected that the simulation could fly")
        loads = _loads(block)
        if not loads.any():
            raise CannotFly("the simulation gives no loads that could move its flight")
        try:
            own = own_maneuver(simulation, block.maneuvers[0])
        except FreqidError as error:
            raise CannotFly(f"the simulation's own flight fails: {error.message}") from None
        if own is None:
            raise CannotFly("the simulation does not fly, or not with effectors of its own")
        record = own.record
        effectors = tuple(n for n in record.group("effector") if np.ptp(record[f"effector/{n}"]) > 0)
        try:
            loop = _loop(block, own, effectors, driven)
        except (FreqidError, np.linalg.LinAlgError) as error:
            raise CannotFly(f"no closed loop can be made of the simulation's flight: {error}") from None
        states = tuple(
            n
            for n, moves in zip(STATES, loop.moving, strict=True)
            if moves and all(f"state/{n}" in m.record for m in block.maneuvers)
        )
        each = np.array([_spectra(m.record, states, block.lines) for m in block.maneuvers])
        measured, flown = each.mean(axis=0), _spectra(record, states, block.lines)
        power = _noise(block, states, measured - flown)
        return cls(
            block,
            record,
            states,
            driven,
            measured[:, driven],
            flown[:, driven],
            power[:, driven],
            loop,
            effectors,
            loads,
        )

    def moved_by(self, rows: Complex) -> Complex:
        """Return the increment of the motion, shape (state, line), by what is added to rows of the block.

        Parameters
        ----------
        rows : ndarray of complex, shape (row, line)
            On all lines of the block, in its rows' units.
        """
        there = rows[:, self.lines]
        displaced = np.zeros((len(self.effectors), self.lines.size), dtype=complex)
        for row, z in zip(self.block.rows, there, strict=True):
            kind, _, name = row.name.partition("/")
            if kind == "actuator" and name in self.effectors:
                displaced[self.effectors.index(name)] = z
        motion = self.loop.moved_by(self.loads @ there, displaced)
        return motion[[STATES.index(n) for n in self.states]]

    def steady(self, left: Complex) -> Complex:
        """Return what is left of the motion without what ends and drifts make of it, shape (state, line)."""
        basis, _ = self._unsteady
        white = self._white(left[None])[0]
        real, imag = np.split(white - (white @ basis.T) @ basis, 2)
        steady: Complex = np.reshape(real + 1j * imag, left.shape)
        return steady / np.sqrt(2 / self.power)

    def energy(self, left: Complex) -> Array:
        """Return squares over noise of what is left of the motion, shape (number,); one where noise is all.

        Parameters
        ----------
        left : ndarray of complex, shape (state, line)
            What ends and drifts make of it is taken out.
        """
        return self._white(self.steady(left)[None])[0] ** 2 + self._unsteady[1]

    def _white(self, z: Complex) -> Array:
        """Return spectra, shape (column, state, line), as numbers of variance one, shape (column, number)."""
        flat = (np.sqrt(2 / self.power) * z).reshape(len(z), -1)
        return np.concatenate([flat.real, flat.imag], axis=1)

    @cached_property
    def _unsteady(self) -> tuple[Array, Array]:
        """An orthonormal basis of what ends and drifts make, and its share in each number."""
        z = self.loop.unsteady()[:, [STATES.index(n) for n in self.states]]
        white = self._white(z)
        white = white / np.maximum(np.linalg.norm(white, axis=1, keepdims=True), np.finfo(float).tiny)
        _, size, basis = np.linalg.svd(white, full_matrices=False)
        basis = basis[size > _EMPTY * size[0]]
        return basis, (basis**2).sum(axis=0)

    def logged_with(self, effect: Effect, settings: Mapping[str, float]) -> Complex:
        """Return what an effect of sensors makes of the log of the flight, shape (state, line)."""
        assert effect.distort is not None
        values = {**in_force_of(effect, self.block.trial.simulation), **settings}
        logged = effect.distort(values, self.record)
        return _spectra(logged, self.states, self.block.lines)[:, self.lines] - self.flown


def _spectra(record: FlightRecord, states: Sequence[str], lines: Lines) -> Complex:
    return steady_spectra(record, [f"state/{n}" for n in states], lines)


def _loop(block: Block, own: Maneuver, effectors: Sequence[str], driven: NDArray[np.intp]) -> Loop:
    """Return the simulation's loop: its own loads and actuators, and the law that the records tell."""
    trial, lines = block.trial.nominal, block.lines
    records = [m.record for m in block.maneuvers]
    moved = [n if n in trial.positions else "" for n in effectors]
    sent = [f"command/{n}" if p else f"effector/{n}" for n, p in zip(effectors, moved, strict=True)]
    gains = law_of(records, sent, [f"excitation/{n}" for n in effectors], lines)
    positions = trial.simulation.positions(records[0])
    actuators = np.ones((len(effectors), driven.size), dtype=complex)
    commands = steady_spectra(records[0], sent, lines)[:, driven]
    time = records[0].time - records[0].time.mean()
    for i, name in enumerate(moved):
        if name:
            x = positions[name]
            z = lines.spectrum(x - np.polyval(np.polyfit(time, x, 1), time))[driven]
            actuators[i] = _smooth_response(lines.hz[driven], commands[i], z)
    slopes = _slopes(Replay(trial.simulation, trial.maneuver.record, own.vehicle), effectors)
    return Loop.of(
        own.record,
        own.vehicle,
        effectors,
        slopes,
        feedback_on(gains, actuators, lines.hz[driven]),
        lines.hz[driven],
    )


def _smooth_response(hz: Array, command: Complex, position: Complex) -> Complex:
    """Return an actuator's response by command as a polynomial in s, which weak lines cannot spoil."""
    s = 2j * np.pi * hz / hz[-1]
    columns = np.array([s**k for k in range(_ORDER + 1)])
    weighted = columns * command
    real = np.concatenate([weighted.real, weighted.imag], axis=1)
    found = np.linalg.lstsq(real.T, np.concatenate([position.real, position.imag]), rcond=None)[0]
    return np.asarray(found @ columns, dtype=np.complex128)


def _noise(block: Block, states: Sequence[str], residual: Complex) -> Array:
    """Return the noise's power of each state, shape (state, line): that of sensors, or as it was flown.

    Lines that nothing drives hold gusts too; what the two flights differ by there is a smooth function of
    frequency.
    """
    sigma = [sensor_noise(m.record, [f"state/{n}" for n in states]) for m in block.maneuvers]
    white = np.array([np.mean([s[f"state/{n}"] ** 2 for s in sigma]) for n in states]) / len(sigma)
    sensors = np.repeat((white * block.lines.dt)[:, None], block.lines.hz.size, axis=1)
    sensors = np.maximum(sensors, np.finfo(float).tiny)
    undriven = (~block.lines.driven).astype(float)
    undriven[0] = 0.0
    if not undriven.any():
        return sensors
    power = np.abs(residual) ** 2 / sensors
    return sensors * np.maximum(smooth_ratio(block.lines.hz, power, undriven), 1.0)


def _loads(block: Block) -> Array:
    """Return the loads that one unit of each row is, shape (6, row); none for other rows."""
    trial = block.trial
    replay = Replay(trial.simulation, trial.maneuver.record, trial.maneuver.vehicle)
    found = np.zeros((len(WRENCH), len(block.rows)))
    for k in range(len(WRENCH)):
        one = np.zeros((len(WRENCH), replay.record.time.size))
        one[k] = 1.0
        for i, row in enumerate(replay.responses(one)):
            if row.any():
                found[k, i] = 1 / row.mean()
    return found


def _slopes(replay: Replay, effectors: Sequence[str]) -> Array:
    """Return X to N per unit of u v w p q r and effectors, shape (6, 6 + effector), means over the flight."""
    record = replay.record
    channels = [n for n in (*_MOTION, *(f"effector/{n}" for n in effectors)) if n in record]
    found = np.zeros((len(WRENCH), 6 + len(effectors)))
    places = [
        _MOTION.index(n) if n in _MOTION else 6 + effectors.index(n.partition("/")[2]) for n in channels
    ]
    found[:, places] = replay.gradients(channels).mean(axis=2).T
    return found

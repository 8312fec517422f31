"""A flight that nobody has flown: the simulation flies it, and the model's columns are computed along it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.channels import VELOCITY
from freqid.core.errors import DataError, ImpossibleSettings, UsageError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.results.design import MultisineDesign, SampledInputs
from freqid.design.multisine.orthogonal_set import sampled
from freqid.gap.infer.block_matrices import BlockMatrices, Products
from freqid.gap.infer.columns import Columns
from freqid.gap.model.candidate import Candidate
from freqid.gap.model.changes import change
from freqid.gap.model.form import form_columns, form_terms, in_rows, product_columns, shared_columns
from freqid.gap.model.testable import in_force_of, untestable
from freqid.gap.model.tolerance import record_columns, tolerance_columns
from freqid.gap.next.rivals import RivalExplanations
from freqid.gap.simulation import Simulation
from freqid.gap.stack.block import Block
from freqid.gap.stack.lines import lines_of
from freqid.gap.stack.motion import Motion, air_of, fed_back, own_flight
from freqid.gap.stack.noise import Draws
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects.effect import Effect

_AIRFRAME = 1e-3  # of the noise: positions that a tolerance moves by less stay as they are


@dataclass(frozen=True, eq=False)
class FlightContext:
    """What a predicted flight has in common with those at hand.

    Attributes
    ----------
    simulation : Simulation
    rivals : RivalExplanations
    candidates : dict of Effect
    sizes : dict of float
        Tolerances, one sigma by name.
    band_hz : tuple of 2 floats
    blocks : sequence of Block
        That were used.
    columns : sequence of Columns
        Of these.
    """

    simulation: Simulation
    rivals: RivalExplanations
    candidates: Mapping[str, Effect]
    sizes: Mapping[str, float]
    band_hz: tuple[float, float]
    blocks: Sequence[Block]
    columns: Sequence[Columns]

    @cached_property
    def allowed(self) -> dict[str, float]:
        """Tolerances, those at zero that the rivals' separations do not depend on."""
        left_out = set(self.rivals.system.tolerances) - set(self.rivals.tolerances)
        return {**self.sizes, **dict.fromkeys(left_out, 0.0)}

    @cached_property
    def airframe(self) -> frozenset[str]:
        """Tolerances that move no actuator."""
        found = set(self.rivals.system.tolerances)
        for block, columns in zip(self.blocks, self.columns, strict=True):
            rows = [i for i, r in enumerate(block.rows) if r.kind == "actuator"]
            power = np.abs(columns.sigmas[:, rows]) ** 2 / block.noise_power[rows]
            moves = np.flatnonzero(power.sum(axis=(1, 2)) > _AIRFRAME)
            found -= {self.rivals.system.tolerances[i] for i in moves}
        return frozenset(found)


@dataclass(frozen=True, eq=False)
class PredictedFlight:
    """Whitened columns of a flight that was simulated.

    Attributes
    ----------
    effects, tolerances, own, shared, form : ndarray, shape (column, number)
        `own` are unknowns of this flight alone, `shared` errors of form of size one that are the same in
        all flights; `form` at the size that the data give.
    shared_row : ndarray of int, shape (column,)
        Term of each of the shared.
    """

    effects: Array
    tolerances: Array
    own: Array
    shared: Array
    form: Array
    shared_row: NDArray[np.intp]

    def matrices(self, flights: int = 1) -> BlockMatrices:
        """Return the inner products of so many of these flights.

        Noise is another in each and so are offsets; the error of form is the same.
        """
        root = np.sqrt(flights)
        number = self.effects.shape[1]
        unknown = np.concatenate([self.own, root * self.form])
        return Products.of(
            root * self.effects,
            root * self.tolerances,
            np.zeros(number),
            unknown,
            np.zeros((0, number)),
            root * self.shared,
        ).matrices(shared_row=self.shared_row)


def fly_alone(simulation: Simulation, design: MultisineDesign, at: str, like: Block) -> FlightRecord | None:
    """Return one period of a design as the simulation flies it.

    Parameters
    ----------
    simulation : Simulation
    design : MultisineDesign
    at : str
        Reference condition.
    like : Block
        Whose channels the record has.

    Returns
    -------
    FlightRecord or None
        None where the simulation does not fly, diverges, or leaves out effectors that a control law moves.
    """
    asked = _asked(like, sampled(replace(design, dt_s=like.lines.dt, periods=1)), at)
    try:
        flown = own_flight(simulation, asked)
    except (DataError, UsageError):
        return None
    if not flown:
        return None
    if not any(n.startswith("effector/") for n in flown):
        if fed_back(like.maneuvers[0].record):
            return None
        flown |= _moved(simulation, asked)
    channels = [replace(asked.channel(n), values=x) for n, x in flown.items() if n in asked]
    record = asked.with_channels(*channels)
    return record.with_channels(*_air_channels(record)) if all(n in record for n in VELOCITY) else record


def _moved(simulation: Simulation, asked: FlightRecord) -> dict[str, Array]:
    """Return positions of effectors that follow the injected signals alone, by channel."""
    simulated = simulation.positions(asked)
    found = {}
    for name in asked.group("excitation"):
        channel = f"effector/{name}"
        if channel in asked:
            found[channel] = simulated.get(name, asked[channel] + asked[f"excitation/{name}"])
    return found


def _asked(like: Block, inputs: SampledInputs, at: str) -> FlightRecord:
    """Return a record of the mean levels of another one, with signals injected."""
    record = like.motion.maneuver.record
    unit = dict(zip(inputs.names, inputs.units, strict=True))
    injected = dict(zip(inputs.names, inputs.values, strict=True))
    time = inputs.time
    channels: dict[str, Channel] = {}
    for name, channel in record.channels.items():
        group, _, short = name.partition("/")
        if group != "excitation":
            level = np.full(time.size, float(channel.values.mean()))
            channels[name] = replace(channel, values=level + injected.get(short, 0.0) * (group == "command"))
    for name, values in injected.items():
        channels[f"excitation/{name}"] = Channel(
            f"excitation/{name}", unit[name], values, 1 / like.lines.dt, "proposed"
        )
    return replace(record, time=time, channels=channels, reference=at)


def _air_channels(record: FlightRecord) -> list[Channel]:
    """Return the air channels of a record as its velocities give them."""
    found = air_of(*record.matrix(VELOCITY))
    if "air/qbar" in record and "air/rho" in record:
        found["air/qbar"] = 0.5 * record["air/rho"] * found["air/V"] ** 2
    return [replace(record.channel(n), values=x) for n, x in found.items() if n in record]


def predict_columns(
    around: FlightContext, record: FlightRecord, like: Block, periods: int
) -> PredictedFlight | None:
    """Return the columns along a simulated flight, with the noise of one that was flown.

    Parameters
    ----------
    around : FlightContext
    record : FlightRecord
        Of `fly_alone`: one period.
    like : Block
        Whose noise is taken, row by row and line by line.
    periods : int
        How many are to be flown.

    Returns
    -------
    PredictedFlight or None
        None where the flight has other rows, or something cannot be computed along it.
    """
    try:
        block = _block(around, record, like, periods)
        return _columns(around, block, like) if block else None
    except (DataError, UsageError):
        return None


def _block(around: FlightContext, record: FlightRecord, like: Block, periods: int) -> Block | None:
    maneuver = Maneuver(record, like.trial.maneuver.vehicle)
    trial = replace(_QuickTrial.of(around.simulation, maneuver, carries=False), still=around.airframe)
    rows, there = [r.name for r in trial.measured.rows], [r.name for r in like.rows]
    if not set(rows) <= set(there):
        return None
    lines = lines_of(record, around.band_hz[1])
    at = [there.index(n) for n in rows]
    near = np.abs(like.lines.hz - lines.hz[:, None]).argmin(axis=1)
    near[1:] = np.maximum(near[1:], 1)  # the zero line has noise of its own
    covariance = like.covariance[near][:, at][:, :, at] * (len(like.names) / periods)
    draws = Draws(
        like.draws.odd[:, at][:, :, near], like.draws.bias[at][:, near], like.draws.bias_error[at][:, near]
    )
    residual = np.zeros((1, len(rows), lines.hz.size), dtype=complex)
    motion = Motion(maneuver, "own flight", 0.0)
    made = trial, like.sigma, draws, residual, covariance, like.noise_from
    return Block(("next flight",), (maneuver,), lines, motion, *made, plain=trial, as_logged=trial)


def _columns(around: FlightContext, block: Block, like: Block) -> PredictedFlight:
    """Return the whitened columns of a block."""
    rivals = around.rivals
    none = np.zeros((len(block.rows), block.lines.hz.size), dtype=complex)
    effects = [
        z for c in rivals.system.candidates for z in _columns_of(c, around.candidates[c.effect], block)
    ]
    stated = tolerance_columns(block, around.candidates, around.allowed)
    own = list(record_columns(block, around.candidates, around.sizes).values())
    own += [z for n, z in stated.items() if n not in rivals.system.tolerances]  # of what did not move before
    before = around.columns[list(around.blocks).index(like)]
    share = dict(zip(before.form_names, np.array(rivals.form_error.loads).tolist(), strict=True))
    terms = [*form_columns(block, form_terms(block)), *product_columns(block)]
    form = in_rows(block, [c._replace(spectra=share.get(c.term, 0.0) * c.spectra) for c in terms])
    form = [z for z in form if np.any(z)]
    tolerances = [stated.get(n, none) for n in rivals.system.tolerances]
    same = shared_columns(block)
    alike = [same.get(n, none) for n in before.shared_names]
    x, t, o, a, d = (_white(block, z) for z in (effects, tolerances, own, alike, form))
    return PredictedFlight(x, t, o, a, d, before.matrices.shared_row)


def _white(block: Block, columns: Sequence[Complex]) -> Array:
    """Return columns, shape (row, line) each, as whitened numbers, shape (column, number)."""
    if not columns:
        return np.zeros((0, len(block.rows) * (2 * block.lines.hz.size - 1)))
    return block.white(np.array(columns))


def _columns_of(candidate: Candidate, effect: Effect, block: Block) -> Complex:
    """Return what a candidate makes of a block at each of its sizes; zero where it cannot be there."""
    c = candidate
    found = np.zeros((c.sizes.size, len(block.rows), block.lines.hz.size), dtype=complex)
    effect = effect.of(block.trial.maneuver.vehicle)
    if untestable(effect, block.trial):
        return found
    force = in_force_of(effect, block.trial.simulation)
    for k in range(c.sizes.size):
        with suppress(ImpossibleSettings):
            found[k] = block.transform(change(effect, block.trial, c.settings(k, force)))
    return found


@dataclass(frozen=True, eq=False)
class _QuickTrial(Trial):
    """A trial that does not ask for positions again where a parameter moves none.

    Attributes
    ----------
    still : frozenset of str
        Such parameters of the simulation.
    """

    still: frozenset[str] = frozenset()

    def _moves_actuators(self, names: Iterable[str]) -> bool:
        return not set(names) <= self.still and super()._moves_actuators(names)

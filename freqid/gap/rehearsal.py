"""A flight that is not flown yet: what effects, tolerances and noise would make of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from freqid.core.design import SampledInputs
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.core.scenario import Reference
from freqid.gap.compare import Compared
from freqid.gap.lines import Lines, lines_of
from freqid.gap.signature import signature
from freqid.gap.simulation import Simulation
from freqid.gap.testable import untestable
from freqid.gap.tolerance import form, tolerances
from freqid.gap.trial import Trial
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_LEAST = 0.05  # of a row's noise power: what is left of it without the error of the model's form


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """Columns along one flight, flown or simulated, on its lines.

    Attributes
    ----------
    trial : Trial
        Of the flight without noise.
    lines : Lines
    floor : ndarray of complex, shape (line, row, row)
        Noise without the error of the model's form.
    form : ndarray, shape (row, line)
        Power of that error, which grows with the motion.
    columns : dict of ndarray of complex, shape (row, line)
        Signatures and common tolerances by name.
    own : ndarray of complex, shape (tolerance, row, line)
        Tolerances of this flight alone.
    simulated : bool
        Whether nobody has flown it.
    """

    trial: Trial
    lines: Lines
    floor: Complex
    form: Array
    columns: Mapping[str, Complex]
    own: Complex
    simulated: bool

    @property
    def at(self) -> str:
        """Its reference condition."""
        return self.trial.maneuver.record.reference

    def gram(self, names: Sequence[str], power: Array) -> Array:
        """Return products of columns, shape (name, name), were each line moved by so much of its power.

        Signatures and tolerances grow with the motion, and so does the error of the model's form; noise
        does not.

        Parameters
        ----------
        names : sequence of str
            A column that the flight does not have is zero.
        power : ndarray, shape (line,)
            Zero for lines that are left out.
        """
        kept = np.flatnonzero(power > 0)
        count = len(names) + len(self.own)
        stack = np.zeros((count, len(self.form), kept.size), dtype=complex)
        for i, name in enumerate(names):
            if name in self.columns:
                stack[i] = self.columns[name][:, kept]
        stack[len(names) :] = self.own[:, :, kept]
        stack *= np.sqrt(power[kept])
        noise = self.floor[kept] + (self.form[:, kept] * power[kept]).T[:, :, None] * np.eye(len(self.form))
        white = np.linalg.solve(np.linalg.cholesky(noise), stack.transpose(2, 1, 0)).reshape(-1, count)
        flat = np.concatenate([white.real, white.imag])
        whole = 2 * flat.T @ flat
        inner = whole[len(names) :, len(names) :] + np.eye(len(self.own))
        across = whole[len(names) :, : len(names)]
        return whole[: len(names), : len(names)] - across.T @ cho_solve(cho_factor(inner), across)


def flown(compared: Compared, sizes: Mapping[str, float]) -> Rehearsal:
    """Return a manoeuvre that was flown, to be flown again in part or with other power.

    Parameters
    ----------
    compared : Compared
    sizes : dict of float
        Tolerances, of `tolerance.stated`.
    """
    c, covariance = compared, compared.noise.covariance
    wrong = form(c.trial, c.lines, sizes)
    diagonal = np.einsum("lii->il", covariance).real
    left = np.maximum(1 - wrong / diagonal, _LEAST)
    root = np.sqrt(left).T
    own = np.array(list(c.own.values())).reshape(-1, *c.residual.shape)
    columns = {**c.signatures, **c.common}
    floor = covariance * root[:, :, None] * root[:, None, :]
    return Rehearsal(c.trial, c.lines, floor, wrong, columns, own, simulated=False)


def simulated(
    simulation: Simulation,
    inputs: SampledInputs,
    reference: Reference,
    like: Compared,
    rivals: Mapping[str, Effect],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    loops: dict[float, Any],
) -> Rehearsal | None:
    """Return a flight in the simulation, with the noise of one that was flown.

    Parameters
    ----------
    simulation : Simulation
    inputs : SampledInputs
        Added to what the control law commands.
    reference : Reference
        Where it starts, trimmed.
    like : Compared
        Has the sensors, the duration and the noise.
    rivals, library : dict of Effect
        That signatures are wanted of, and whose parameters may be a little off.
    sizes : dict of float
        Tolerances.
    loops : dict
        Trims and law by density; what is missing is added.

    Returns
    -------
    Rehearsal or None
        None where the simulation cannot fly, fails, or has other sensors.
    """
    maneuver = _fly(simulation, inputs, reference, like, loops)
    if maneuver is None:
        return None
    try:
        trial = Trial.of(simulation, maneuver)
    except DataError:
        return None
    low, high = float(like.lines.hz[0]), float(like.lines.hz[-1])
    lines = lines_of(maneuver.record, (0.999 * low, 1.001 * high))
    if [r.name for r in trial.measured.rows] != [r.name for r in like.rows]:
        return None
    columns: dict[str, Complex] = {}
    for effect in (e.of(maneuver.vehicle) for e in rivals.values()):
        if untestable(effect, trial) is None:
            found = signature(effect, trial)
            columns |= {f"{effect.id}:{n}": lines.transform(change) for n, change in found.items()}
    allowed = tolerances(trial, library, sizes)
    columns |= {name: lines.transform(change) for name, change in allowed.common.items()}
    own = np.array([lines.transform(change) for change in allowed.own.values()])
    near = np.abs(like.lines.hz - lines.hz[:, None]).argmin(axis=1)
    floor = flown(like, sizes).floor[near]
    own = own.reshape(-1, len(trial.measured.rows), lines.hz.size)
    return Rehearsal(trial, lines, floor, form(trial, lines, sizes), columns, own, simulated=True)


def _fly(
    simulation: Simulation,
    inputs: SampledInputs,
    reference: Reference,
    like: Compared,
    loops: dict[float, Any],
) -> Maneuver | None:
    """Fly in calm air, sensors where those of a manoeuvre are, without their errors."""
    from freqid.gap.connect.scenario import ScenarioSimulation
    from freqid.simulate import sensors
    from freqid.simulate.lq import close_loop
    from freqid.simulate.maneuver import Conditions, fly_maneuver

    if not isinstance(simulation, ScenarioSimulation):
        return None
    scenario, record = simulation.scenario, like.maneuver.record
    suites = scenario.simulation.sensors
    if not suites:
        return None
    logged = {
        name: {c for s in sensors.suite(scenario, name).values() for c in s.channels} for name in suites
    }
    carried = max(logged, key=lambda n: len(logged[n] & set(record.channels)))
    calm = msgspec.structs.replace(scenario, simulation=msgspec.structs.replace(scenario.simulation, wind={}))
    conditions = Conditions(sensors=carried, log_rate=1 / record.dt)
    try:
        loop = loops[reference.rho] = loops.get(reference.rho) or close_loop(calm, reference)
        made = fly_maneuver(calm, reference, inputs, conditions, loop=loop, duration=record.duration)
    except (DataError, UsageError):
        return None
    if made.divergence:
        return None
    kept = [c for n, c in made.record.channels.items() if n in record or n.startswith("excitation/")]
    alone = replace(made.record, channels={c.name: c for c in kept})
    return Maneuver.of(alone, like.maneuver.vehicle)

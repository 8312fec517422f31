"""One manoeuvre beside a simulation, on lines: residual, noise, signatures and tolerances in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import Maneuver
from freqid.gap.driven import driven
from freqid.gap.evidence import IN_ROW
from freqid.gap.histories import Histories, Row
from freqid.gap.lines import Lines, lines_of
from freqid.gap.noise import Noise, draws, noise_of
from freqid.gap.quiet import noisy_channels, quiet
from freqid.gap.residual import measured_part, simulated_part
from freqid.gap.shared_noise import Shared, shared_noise
from freqid.gap.signature import scale_of, signature, sources_of
from freqid.gap.simulation import Simulation
from freqid.gap.testable import untestable
from freqid.gap.tolerance import DYNAMICS, OF_EFFECT, form, tolerances
from freqid.gap.trial import Trial
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Compared:
    """What is known of one manoeuvre.

    Attributes
    ----------
    maneuver : Maneuver
        As it was logged.
    measured : Histories
    predicted : ndarray, shape (response, sample)
    trial : Trial
        Of what the injected signals alone would have made of the manoeuvre, where that is known, else of the
        manoeuvre without its noise; signatures and tolerances come from it.
    smoothed : Maneuver
        Without its noise, as it was flown.
    lines : Lines
    residual : ndarray of complex, shape (row, line)
        Units of the rows times sqrt(s).
    noise : Noise
    signatures : dict of ndarray of complex, shape (row, line)
        By ``effect:parameter``, for each unit of it.
    common : dict of ndarray of complex, shape (row, line)
        Tolerances that all manoeuvres share, by name, for one sigma.
    own : dict of ndarray of complex, shape (row, line)
        Those of this manoeuvre alone.
    draws : ndarray of complex, shape (draw, row, line)
        Residuals that noise alone makes.
    shared : Shared
        Noise that the residual has in common with what is computed from the record.
    sources : dict of tuple of str
        Channels that a signature is computed from, by ``effect:parameter``.
    scales : dict of float
        What is expected of a parameter before any data, by ``effect:parameter``.
    not_tested : dict of str
        Why, by effect.
    """

    maneuver: Maneuver
    measured: Histories
    predicted: Array
    trial: Trial
    smoothed: Maneuver
    lines: Lines
    residual: Complex
    noise: Noise
    signatures: dict[str, Complex]
    common: dict[str, Complex]
    own: dict[str, Complex]
    draws: Complex
    shared: Shared
    sources: dict[str, tuple[str, ...]]
    scales: dict[str, float]
    not_tested: dict[str, str]

    @property
    def rows(self) -> tuple[Row, ...]:
        """Of residual, signatures and tolerances."""
        return self.trial.measured.rows

    @cached_property
    def flown(self) -> Trial:
        """Of the manoeuvre as it was flown, by which large changes are told: the gap moved the flight too."""
        same = self.smoothed is self.trial.maneuver
        return self.trial if same else Trial.of(self.trial.simulation, self.smoothed)

    @cached_property
    def white_common(self) -> dict[str, Array]:
        """Common tolerances as white numbers."""
        return {name: self.white(z) for name, z in self.common.items()}

    @cached_property
    def white_own(self) -> Array:
        """Tolerances of the manoeuvre alone as white numbers, shape (tolerance, 2 row line)."""
        return self.white(np.array(list(self.own.values())).reshape(-1, *self.residual.shape))

    @cached_property
    def white_draws(self) -> Array:
        """Draws of noise as white numbers, shape (draw, 2 row line)."""
        return self.white(self.draws)

    @cached_property
    def attenuation_common(self) -> dict[str, float]:
        """What shared noise adds to the products of common tolerances with the residual."""
        return self.attenuation(self.common)

    @cached_property
    def attenuation_own(self) -> Array:
        """The same of the manoeuvre's own tolerances, shape (tolerance,)."""
        return np.array(list(self.attenuation(self.own).values()))

    def white(self, z: Complex) -> Array:
        """Return rows on lines as white numbers, shape (..., 2 row line)."""
        return self.noise.white(z)

    def attenuation(
        self, columns: Mapping[str, Complex], sources: Mapping[str, tuple[str, ...]] | None = None
    ) -> dict[str, float]:
        """Return what noise adds to the products of columns with the residual, by name.

        Parameters
        ----------
        columns : dict of ndarray of complex, shape (row, line)
        sources : dict of tuple of str, optional
            Channels that columns beside the signatures are computed from, by name.
        """
        known = {**self.sources, **(sources or {})}
        groups: dict[tuple[str, ...], list[str]] = {}
        for name in columns:
            kind = name.partition(":")[0]
            usual = () if kind == DYNAMICS else self.trial.inputs  # actuators follow commands: no noise
            source = known.get(name.removeprefix(OF_EFFECT).partition(IN_ROW)[0], usual)
            groups.setdefault(source, []).append(name)
        found: dict[str, float] = {}
        for channels, names in groups.items():
            extra = self.shared.attenuation(np.array([columns[n] for n in names]), channels)
            found |= dict(zip(names, extra.tolist(), strict=True))
        return {name: found[name] for name in columns}


def compare(
    simulation: Simulation,
    maneuver: Maneuver,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    band_hz: tuple[float, float],
    *,
    count: int = 200,
    seed: int = 0,
    cache: Path | None = None,
) -> Compared:
    """Replay a simulation on a manoeuvre and prepare all that a diagnosis compares.

    Parameters
    ----------
    simulation : Simulation
    maneuver : Maneuver
    library : dict of Effect
        Candidates by id.
    sizes : dict of float
        Tolerances, of `tolerance.stated`.
    band_hz : tuple of 2 floats
        Hz.
    count : int
        Draws of the sensors' noise.
    seed : int
    cache : Path, optional
        Folder in which these draws are kept from one diagnosis to the next.

    Raises
    ------
    DataError
        Where the record lacks a channel that the simulation or a response needs.
    """
    record = maneuver.record
    positions = simulation.positions(record)
    measured = measured_part(maneuver, simulation.responses, tuple(positions))
    predicted = simulation.predict(record)
    lines = lines_of(record, band_hz)
    z = lines.transform(measured - simulated_part(measured, predicted, positions))
    expected = {f"effector/{n}": x for n, x in positions.items()}
    for name, row in zip(simulation.responses, predicted, strict=True):
        expected[f"response/{name}" if f"response/{name}" in record else f"state/{name}"] = row
    alone = driven(simulation, maneuver, lines)
    quieted = quiet(record, noisy_channels(record), expected, alone)
    trial = Trial.of(simulation, Maneuver(quieted.record, maneuver.vehicle))
    smoothed = trial.maneuver
    if alone:
        smoothed = Maneuver(quiet(record, noisy_channels(record), expected).record, maneuver.vehicle)
    own_noise, added = draws(maneuver, lines, measured, predicted, trial, quieted.sigma, count, seed, cache)
    shape = np.sqrt(form(trial, lines, sizes) / 2)
    rng = np.random.default_rng([seed, 3])
    wrong = rng.standard_normal((2, *own_noise.shape))
    own_noise = own_noise + shape * (wrong[0] + 1j * wrong[1])
    noise = noise_of(trial.maneuver, lines, measured, z, own_noise, quieted.sigma)
    not_tested, slopes, sources, scales = {}, {}, {}, {}
    for effect in (e.of(maneuver.vehicle) for e in library.values()):
        reason = untestable(effect, trial)
        if reason:
            not_tested[effect.id] = reason
            continue
        for name, change in signature(effect, trial).items():
            slopes[f"{effect.id}:{name}"] = change
            scales[f"{effect.id}:{name}"] = scale_of(effect, name)
            sources[f"{effect.id}:{name}"] = sources_of(effect, trial, name)
    allowed = tolerances(trial, library, sizes, slopes)
    return Compared(
        maneuver=maneuver,
        measured=measured,
        predicted=predicted,
        trial=trial,
        smoothed=smoothed,
        lines=lines,
        residual=z,
        noise=noise,
        signatures={name: lines.transform(change) for name, change in slopes.items()},
        common={name: lines.transform(change) for name, change in allowed.common.items()},
        own={name: lines.transform(change) for name, change in allowed.own.items()},
        draws=noise.louder(own_noise, seed),
        shared=shared_noise(quieted, lines, noise, own_noise, added),
        sources=sources,
        scales=scales,
        not_tested=not_tested,
    )

"""Two simulations beside one manoeuvre: their residuals on the same lines, in the same noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.gap.histories import Histories, Row
from freqid.gap.lines import Lines, lines_of
from freqid.gap.locate import regime
from freqid.gap.noise import draws, noise_of
from freqid.gap.quiet import noisy_channels, quiet
from freqid.gap.residual import measured_part, simulated_part
from freqid.gap.shared_noise import left_over, shared_noise
from freqid.gap.simulation import Simulation
from freqid.gap.tolerance import DYNAMICS, form, tolerances
from freqid.gap.trial import Trial
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Beside:
    """One manoeuvre and what two simulations leave of it; complex values in unit of the row times sqrt(s).

    Attributes
    ----------
    rows : tuple of Row
        That both simulations predict: responses, and actuators.
    regime : str
    lines : Lines
    left : tuple of 2 ndarray of complex, shape (row, line)
        Residuals of A and B.
    covariance : ndarray of complex, shape (line, row, row)
        Of noise and of errors of form.
    noise : tuple of 2 ndarray of complex, shape (draw, row, line)
        What the same draws of the sensors' noise make of each residual.
    louder : ndarray, shape (row, line)
        By which all noise, turbulence too, is more than the sensors'; of amplitudes.
    tolerances : tuple of str
    common : ndarray of complex, shape (tolerance, row, line)
        What these do that all manoeuvres share, for one sigma: half of the power is A's, half is B's.
    own : ndarray of complex, shape (tolerance, row, line)
        The same of those of this manoeuvre alone.
    slopes : ndarray, shape (channel, tolerance, row)
        How common and own tolerances depend on channels.
    shared : tuple of 2 ndarray of complex, shape (channel, row, line)
        Cross-spectra of the noise left in these channels with that of each residual.
    """

    rows: tuple[Row, ...]
    regime: str
    lines: Lines
    left: tuple[Complex, Complex]
    covariance: Complex
    noise: tuple[Complex, Complex]
    louder: Array
    tolerances: tuple[str, ...]
    common: Complex
    own: Complex
    slopes: Array
    shared: tuple[Complex, Complex]

    @property
    def names(self) -> list[str]:
        """Of the rows."""
        return [row.name for row in self.rows]


def beside(
    pair: tuple[Simulation, Simulation],
    maneuver: Maneuver,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    band_hz: tuple[float, float],
    *,
    count: int = 200,
    seed: int = 0,
) -> Beside:
    """Replay two simulations on a manoeuvre.

    Parameters
    ----------
    pair : tuple of 2 Simulation
    maneuver : Maneuver
    library : dict of Effect
        Whose parameters may be a little off.
    sizes : dict of float
        Tolerances, of `tolerance.stated`.
    band_hz : tuple of 2 floats
    count : int
        Draws of the sensors' noise.
    seed : int

    Raises
    ------
    UsageError
        Where the two have no response in common.
    DataError
        Where the record lacks a channel that one of them needs.

    Notes
    -----
    Noise beyond the sensors', as turbulence, is in both residuals alike: it is the lesser of what either
    leaves unexplained, row by row.
    """
    record = maneuver.record
    lines = lines_of(record, band_hz)
    positions = [s.positions(record) for s in pair]
    predicted = [s.predict(record) for s in pair]
    measured = [measured_part(maneuver, s.responses, tuple(p)) for s, p in zip(pair, positions, strict=True)]
    names = _common(pair, measured)
    simulated = [simulated_part(m, y, p) for m, y, p in zip(measured, predicted, positions, strict=True)]
    z = [lines.transform((m - s).select(names)) for m, s in zip(measured, simulated, strict=True)]
    middle = (simulated[0].select(names) + simulated[1].select(names)) * 0.5
    quieted = quiet(record, noisy_channels(record), _expected(middle, record.channels))
    trials = [Trial.of(s, Maneuver(quieted.record, maneuver.vehicle)) for s in pair]
    made: list[Complex] = []
    added: Complex = np.empty(0, dtype=complex)
    for t, m, y in zip(trials, measured, predicted, strict=True):
        all_rows, added = draws(maneuver, lines, m, y, t, quieted.sigma, count, seed)
        made.append(all_rows[:, _at(m, names)])
    forms = [form(t, lines, sizes)[_at(t.measured, names)] for t in trials]
    size = np.sqrt((forms[0] + forms[1]) / 4)  # the mean of both, half of it in the real part
    wrong = np.random.default_rng([seed, 3]).standard_normal((2, *made[0].shape))
    own_noise = (made[0] + made[1]) / 2 + size * (wrong[0] + 1j * wrong[1])
    like = measured[0].select(names)
    noises = [noise_of(trials[0].maneuver, lines, like, x, own_noise, quieted.sigma) for x in z]
    less = np.minimum(noises[0].beyond, noises[1].beyond) - noises[0].beyond
    covariance = noises[0].covariance + less.T[:, :, None] * np.eye(len(less))
    allowed = [tolerances(t, library, sizes) for t in trials]
    common, own = (
        {
            f"{label} {name}": lines.transform(change.select(names)) / np.sqrt(2)
            for label, tolerated in zip("AB", allowed, strict=True)
            for name, change in getattr(tolerated, kind).items()
        }
        for kind in ("common", "own")
    )
    changes = np.array([*common.values(), *own.values()]).reshape(-1, *z[0].shape)
    both = shared_noise(quieted, lines, noises[0], made[0], added)
    slopes = np.zeros((len(both.names), *changes.shape[:2]))
    for label, trial in zip("AB", trials, strict=True):
        kinds = [name.partition(":")[0] for name in (*common, *own)]
        mine = [i for i, k in enumerate(kinds) if k.startswith(label) and k[2:] != DYNAMICS]
        slopes[:, mine] = both.slopes(changes[mine], trial.inputs)
    left = left_over(quieted, lines, added).conj()
    return Beside(
        rows=like.rows,
        regime=regime(record),
        lines=lines,
        left=(z[0], z[1]),
        covariance=covariance,
        noise=(made[0], made[1]),
        louder=1 / np.sqrt(np.maximum(noises[0].sensor_share, noises[1].sensor_share)),
        tolerances=tuple(common),
        common=changes[: len(common)],
        own=changes[len(common) :],
        slopes=slopes,
        shared=tuple(np.einsum("kjl,kil->jil", left, m) / count for m in made),  # type: ignore[arg-type]
    )


def _common(pair: tuple[Simulation, Simulation], measured: list[Histories]) -> list[str]:
    """Return the rows that both predict, kinematic ones left out: no simulation is in these."""
    second = {row.name for row in measured[1].rows}
    found = [row.name for row in measured[0].rows if row.name in second and row.kind != "kinematic"]
    if not set(pair[0].responses) & set(pair[1].responses):
        told = [f"{s.name} predicts {' '.join(s.responses)}" for s in pair]
        raise UsageError(
            f"the two simulations have no response in common: {told[0]}, {told[1]}",
            remedy="compare simulations that predict the same responses",
        )
    return found


def _expected(middle: Histories, channels: Mapping[str, object]) -> dict[str, Array]:
    """Return what channels should be close to: half way between both simulations."""
    found = {}
    for row, values in zip(middle.rows, middle.direct, strict=True):
        if row.kind == "actuator":
            name = f"effector/{row.name.partition('/')[2]}"
        else:
            name = f"response/{row.name}" if f"response/{row.name}" in channels else f"state/{row.name}"
        if name in channels:
            found[name] = values
    return found


def _at(histories: Histories, names: list[str]) -> list[int]:
    have = [row.name for row in histories.rows]
    missing = [name for name in names if name not in have]
    if missing:
        raise DataError(f"'{missing[0]}' is not predicted on the record without its noise")
    return [have.index(name) for name in names]

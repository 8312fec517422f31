"""Which of two simulations is nearer to the same flights, where, and whether the flights can tell.

Both residuals stand on the same rows and lines and are measured with one metric ``S``: one noise covariance,
half of the tolerances' power of each simulation, and the error of form of the better one. The misfit of a
simulation is ``Q = r' S^-1 r``; half the difference of two is the logarithm of their likelihood ratio.

References
----------
Q. H. Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses", *Econometrica* 57, 1989;
R. L. Berger, "Multiparameter hypothesis testing and acceptance sampling", *Technometrics* 24, 1982
(intersection-union tests); S. Holm, "A simple sequentially rejective multiple test procedure", *Scandinavian
Journal of Statistics* 6, 1979.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from freqid.compare.comparison_text import ALL, remarks_on, verdict_on
from freqid.compare.shared_stack import BandHz, SharedBlock, SharedForm, form_of, shared_stack
from freqid.core.arrays import Array, Complex
from freqid.core.errors import UsageError
from freqid.core.record import Maneuver
from freqid.core.results.rivals import Contest, Rivals, Span
from freqid.gap.bookkeeping.gyroscopic import as_counted
from freqid.gap.infer.block_matrices import BlockMatrices, Products
from freqid.gap.model.tolerance import stated
from freqid.gap.settings import INTERVAL, LEVEL
from freqid.gap.simulation import Simulation
from freqid.identify.regress.confidence_interval import confidence_interval
from freqid.simulate.effects.effect import Effect

SMALLEST_DIFFERENCE = 0.01
"""Share of the farther one's misfit: a simulation that is nearer by less is not called nearer."""

_FEWEST = 4  # real numbers of a cell


@dataclass(frozen=True)
class Cell:
    """Rows, lines and conditions of one contest; an edge between bands belongs to the lower one."""

    response: str
    band_hz: BandHz
    regime: str

    def numbers(self, block: SharedBlock) -> NDArray[np.bool_] | None:
        """Return which real numbers of a row are in the cell; None where the block has none."""
        if self.regime not in (block.regime, ALL) or self.response not in block.rows:
            return None
        (low, high), hz = self.band_hz, block.lines.hz
        at = (hz >= low if low == 0 else hz > low) & (hz <= high)
        return np.concatenate([at, at[1:]]) if at.any() else None


@dataclass(frozen=True)
class Difference:
    """How far one residual is smaller than another, and how sure that is.

    Attributes
    ----------
    count : int
        Real numbers of variance one.
    misfits : tuple of 2 floats
        ``r' S^-1 r`` of A and B, less what noise makes of them.
    value : float
        Of these misfits, A's less B's.
    noise, scatter : float
        Standard deviations of the value between equally good simulations: by noise and tolerances in what
        both leave, and by tolerances and form in what they differ by.
    columns : float
        The same, by errors of the tolerances' columns.
    """

    count: int
    misfits: tuple[float, float]
    value: float
    noise: float
    scatter: float
    columns: float

    @property
    def deviation(self) -> float:
        """The larger of the two: a difference has to stand out of each (an intersection-union test)."""
        return float(np.hypot(max(self.noise, self.scatter), self.columns))


def compare_two(
    pair: tuple[Simulation, Simulation],
    maneuvers: Sequence[Maneuver],
    names: Sequence[str],
    library: Mapping[str, Effect],
    tolerances: Mapping[str, float],
    band_hz: BandHz,
    *,
    level: float = LEVEL,
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> Rivals:
    """Compare two simulations on the same flights.

    Parameters
    ----------
    pair : tuple of 2 Simulation
        A and B; where they predict different responses, those in common are compared.
    maneuvers : sequence of Maneuver
        Repeats of one manoeuvre are averaged.
    names : sequence of str
        Of the manoeuvres.
    library : dict of Effect
        Whose parameters may be off by a tolerance.
    tolerances : dict of float
        One sigma by name, over the defaults and over what each simulation states of its own parameters.
    band_hz : tuple of 2 floats
    level : float
        How often equal simulations may be told apart anywhere.
    seed : int
        Of the noise that is sent through both simulations.
    tell : callable, optional
        Called with what is being done.

    Raises
    ------
    UsageError
        Where the two have no response in common, or a tolerance is one of neither.
    DataError
        Where a record lacks a channel that one of them needs.
    """
    if not maneuvers:
        raise UsageError("there is no manoeuvre to compare on", remedy="name one record or more")
    if not set(pair[0].responses) & set(pair[1].responses):
        phrases = [f"{s.name} predicts {' '.join(s.responses)}" for s in pair]
        raise UsageError(
            f"the two simulations have no response in common: {phrases[0]}, {phrases[1]}",
            remedy="compare simulations that predict the same responses",
        )
    sizes = _tolerances_of(pair, tolerances, library, maneuvers[0])
    (of_a, said_a), (of_b, said_b) = (as_counted(simulation, maneuvers) for simulation in pair)
    blocks, bands = shared_stack(pair, (of_a, of_b), names, library, sizes, band_hz, seed=seed, tell=tell)
    tell("learning the error of form")
    form = form_of(blocks)
    tell("weighing")
    judged = judge(blocks, bands, form, level)
    titles = (pair[0].name, pair[1].name)
    rotors = [f"{label}: {said.rstrip('.')}" for label, said in (("A", said_a), ("B", said_b)) if said]
    remarks = (*rotors, *remarks_on(pair, blocks, form.loads, judged.identical))
    made = replace(judged, simulations=titles, records=tuple(names), remarks=remarks)
    return replace(made, verdict=verdict_on(made))


def judge(
    blocks: Sequence[SharedBlock], bands: Sequence[BandHz], form: SharedForm, level: float = LEVEL
) -> Rivals:
    """Return the contests of two simulations: one over all, and by response, band and regime.

    Half of the level goes to the one over all, half to the others together, by Holm's procedure.
    """
    whole = (0.0, max(high for _, high in bands))
    overall = _contest(blocks, Cell(ALL, whole, ALL), form)
    contests = [_contest(blocks, cell, form) for cell in _cells(blocks, bands)]
    adjusted = np.minimum(2 * holm([c.p for c in contests]), 1.0)
    overall = _decided(overall, min(2 * overall.p, 1.0), level)
    contests = [_decided(c, float(p), level) for c, p in zip(contests, adjusted, strict=True)]
    identical = all(np.array_equal(*b.residuals) for b in blocks)
    return Rivals(
        "",
        ("A", "B"),
        (),
        level,
        identical,
        overall,
        tuple(contests),
        smallest_difference=SMALLEST_DIFFERENCE,
        form_errors=form.loads,
    )


def holm(p: Sequence[float]) -> Array:
    """Return p-values adjusted for the number of tests, by Holm's step-down procedure."""
    values = np.asarray(p, dtype=float)
    order = np.argsort(values)
    stepped = np.maximum.accumulate(values[order] * np.arange(values.size, 0, -1))
    found = np.empty(values.size)
    found[order] = np.minimum(stepped, 1.0)
    return found


def difference_of(
    matrices: Sequence[BlockMatrices],
    tolerances: int,
    draws: int,
    form_error: float,
    wrong: Array,
) -> Difference:
    """Return the difference of two misfits, and how far equally good simulations differ by chance.

    Parameters
    ----------
    matrices : sequence of BlockMatrices
        Of ``[T, noise of A, noise of B, all noise, a, b]``, by block: tolerances of both simulations times
        sqrt(1/2), what the same draws of the sensors' noise make of each, draws of all noise, and the
        residuals. What is unknown in a record itself is allowed for in them.
    tolerances : int
    draws : int
    form_error : float
    wrong : ndarray, shape (tolerance, tolerance)
        Inner products of the errors of the tolerances' columns.

    Notes
    -----
    With d = a - b, m = (a + b) / 2 and K all columns of tolerances and form, the difference is
    ``2 d' S^-1 m``. Two things may make it without either simulation being nearer.

    Noise and tolerances in m, given d: variance ``4 d' S^-1 d``. Noise of the flown states is in d and in m:
    the mean of what that makes is subtracted, its variance is added, both as the draws show them.

    Tolerances and form in d, which is ``K`` times two independent draws, given what the nearer one, r, still
    lacks: variance ``8 |K' S^-1 r|^2``, eight times the squared posterior mean of its departures. Two
    versions of one simulation have most of their errors in common: where the departures by which the two
    differ are smaller than those of independent draws, ``|K' S^-1 d|^2`` one standard deviation or more below
    its expectation, the variance is less in proportion.

    Columns on a motion that misses a share of the record's leave that share of what tolerances make. The
    squares of two draws of it differ with variance ``4 tr(wrong^2)``, or with ``8 |wrong x|^2`` about the
    departures x that the nearer one has; the larger of these is added to either.
    """
    t = slice(0, tolerances)
    gram = np.sum([m.at_loads(form_error) for m in matrices], axis=0)
    spread = np.linalg.inv(np.eye(tolerances) + gram[t, t])  # posterior covariance of the tolerances
    departed = spread @ gram[t, tolerances:]
    inner = gram[tolerances:, tolerances:] - gram[tolerances:, t] @ departed
    # posterior means of the form's coefficients, given those of the tolerances
    shapes = [_form_columns(m, form_error) for m in matrices]
    learned = np.concatenate([s[:, tolerances:] - s[:, t] @ departed for s, _ in shapes])
    every = np.concatenate([departed, learned])
    allowed = _expected(spread, [s[:, t] for s, _ in shapes], np.concatenate([c for _, c in shapes]))

    power = np.diag(inner)
    each = power[:draws] - power[draws : 2 * draws]
    heard = float(power[2 * draws : 3 * draws].mean())
    bias, by_noise = float(each.mean()), float(each.var(ddof=1)) * (1 + 1 / draws)
    value = float(power[-2] - power[-1]) - bias
    lacking = every[:, -1] if value > 0 else every[:, -2]
    apart = every[:, -2] - every[:, -1]
    number = max(allowed, 1e-300)  # of departures that the flights tell
    independent = min(float(apart @ apart) / (2 * number) + float(np.sqrt(2 / number)), 1.0)
    rest = wrong @ lacking[:tolerances]
    given = float(power[-2] + power[-1] - 2 * inner[-2, -1])
    return Difference(
        count=sum(m.number for m in matrices),
        misfits=(float(power[-2]) - heard - bias / 2, float(power[-1]) - heard + bias / 2),
        value=value,
        noise=float(np.sqrt(4 * max(given, 0.0) + by_noise)),
        scatter=float(np.sqrt(8 * independent * float(lacking @ lacking))),
        columns=float(np.sqrt(independent * max(4 * float((wrong**2).sum()), 8 * float(rest @ rest)))),
    )


def _form_columns(matrices: BlockMatrices, form_error: float) -> tuple[Array, Array]:
    """Return posterior means of the form's coefficients by column, and their variances, tolerances known."""
    variance = 1 / (1 + form_error**2 * matrices.form_power)
    return form_error * variance[:, None] * matrices.form, variance


def _expected(spread: Array, shapes: Sequence[Array], variance: Array) -> float:
    """Return the expected square of posterior means over prior draws of tolerances and form: tr((1 - C)^2).

    Parameters
    ----------
    spread : ndarray, shape (tolerance, tolerance)
        Posterior covariance of the tolerances.
    shapes : sequence of ndarray, shape (direction, tolerance)
        What a departure makes of the form's coefficients, by block.
    variance : ndarray, shape (direction,)
        Posterior variances of the form's coefficients, tolerances known.
    """
    shape = np.concatenate(shapes)
    cross = shape @ spread
    form = np.diag(variance) + cross @ shape.T
    one = np.eye(len(spread)) - spread
    other = np.eye(len(form)) - form
    return float((one**2).sum() + 2 * (cross**2).sum() + (other**2).sum())


def _contest(blocks: Sequence[SharedBlock], cell: Cell, form: SharedForm) -> Contest:
    found = [(b, at) for b in blocks if (at := _numbers_of(cell, b)) is not None]
    names = [dict.fromkeys(n for b, _ in found for n in b.tolerances[i]) for i in (0, 1)]
    matrices = []
    wrong = np.zeros((len(names[0]) + len(names[1]),) * 2)
    for b, (row, at) in found:
        tolerances = np.sqrt(0.5) * b.stacked([b.tolerances[i].get(n) for i in (0, 1) for n in names[i]])
        wrong += _errors_of(b, tolerances, row, at)
        parts = [tolerances, *b.noise, b.louder, b.residuals[0][None]]
        own = np.concatenate([*(np.sqrt(0.5) * z for z in b.own), form.actuators_of(b)])
        columns, rest, unknown, shape = (
            b.white(z, row)[..., at]
            for z in (np.concatenate(parts), b.residuals[1], own, b.form[form.better_loads])
        )
        unknown, shape = (x[np.any(x, axis=1)] for x in (unknown, shape if form.size else shape[:0]))
        none = columns[:0]
        columns = np.concatenate([columns, rest[None]])
        matrices.append(Products.of(columns, none, rest, unknown, shape, none).matrices())
    draws = len(blocks[0].louder)
    w = difference_of(matrices, len(names[0]) + len(names[1]), draws, form.size, wrong)
    same = all(
        np.array_equal(b.residuals[0][..., row, :], b.residuals[1][..., row, :]) for b, (row, _) in found
    )
    value = 0.0 if same else w.value
    low, high = map(float, confidence_interval(value, w.deviation, level=INTERVAL))
    farther = max(*w.misfits, abs(value))
    return Contest(
        response=cell.response,
        band_hz=cell.band_hz,
        regime=cell.regime,
        count=w.count,
        maneuvers=sum(len(b.names) for b, _ in found),
        misfit_a=_misfit(w.misfits[0], w.count),
        misfit_b=_misfit(w.misfits[1], w.count),
        energy_a=w.misfits[0],
        energy_b=w.misfits[1],
        difference=Span(value, low, high),
        less=0.0 if same else abs(value) / max(farther, 1e-300),
        p=1.0 if same else float(2 * norm.sf(abs(value) / max(w.deviation, 1e-300))),
        p_adjusted=1.0,
        nearer="",
    )


def _errors_of(block: SharedBlock, columns: Complex, row: slice | int, at: Any) -> Array:
    """Return inner products of the errors of columns: their motion misses a share of the record's.

    Errors of different rows have nothing to do with each other, while the noise of rows may cancel.
    """
    found = np.zeros((len(columns),) * 2)
    for i in range(len(block.rows)) if isinstance(row, slice) else [row]:
        if not block.missed[i]:
            continue
        alone = np.zeros_like(columns)
        alone[:, i, 1:] = block.missed[i] * columns[:, i, 1:]  # means are the record's
        z = block.white(alone, row)[:, at]
        found += z @ z.T
    return found


def _numbers_of(cell: Cell, block: SharedBlock) -> tuple[slice | int, NDArray[np.bool_] | slice] | None:
    """Return the row of a cell and its real numbers; all of them where the cell is everything."""
    if cell.response == ALL:
        return slice(None), slice(None)
    at = cell.numbers(block)
    return None if at is None else (block.rows.index(cell.response), at)


def _misfit(energy: float, count: int) -> Span:
    """Return a misfit by real number, with the interval of a noncentral chi-square variable."""
    deviation = float(np.sqrt(2 * count + 4 * max(energy, 0.0)))
    low, high = map(float, confidence_interval(energy, deviation, level=INTERVAL))
    return Span(energy / count, low / count, high / count)


def _decided(contest: Contest, adjusted: float, level: float) -> Contest:
    clear = adjusted < level and contest.less >= SMALLEST_DIFFERENCE
    nearer = ("B" if contest.difference.value > 0 else "A") if clear else ""
    return replace(contest, p_adjusted=adjusted, nearer=nearer)


def _cells(blocks: Sequence[SharedBlock], bands: Sequence[BandHz]) -> Iterator[Cell]:
    """Yield responses as a whole, and in bands and regimes, where the two simulations differ."""
    regimes = dict.fromkeys(b.regime for b in blocks)
    for response in dict.fromkeys(row for b in blocks for row in b.rows):
        cells = [Cell(response, band, regime) for regime in regimes for band in bands]
        found = [cell for cell in cells if _differs(blocks, cell)]
        if len(found) > 1:
            yield Cell(response, (bands[0][0], bands[-1][1]), ALL)
        yield from found


def _differs(blocks: Sequence[SharedBlock], cell: Cell) -> bool:
    at = [(b, found) for b in blocks if (found := cell.numbers(b)) is not None]
    differ = any((b.apart(cell.response)[found] != 0).any() for b, found in at)
    return differ and sum(int(found.sum()) for _, found in at) >= _FEWEST


def _tolerances_of(
    pair: tuple[Simulation, Simulation],
    table: Mapping[str, float],
    library: Mapping[str, Effect],
    maneuver: Maneuver,
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the tolerances of either simulation; a name that only one has is no error of the other."""
    tables = []
    for one, other in (pair, pair[::-1]):
        known = {}
        for name, value in table.items():
            try:
                stated({name: value}, library, one, maneuver.vehicle)
            except UsageError:
                stated({name: value}, library, other, maneuver.vehicle)
            else:
                known[name] = value
        tables.append(stated(known, library, one, maneuver.vehicle))
    return tables[0], tables[1]

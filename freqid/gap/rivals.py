"""Which of two simulations is nearer to the same flights, where, and whether the flights can tell."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.core.rivals import Contest, Rivals, Span
from freqid.gap.beside import Beside, beside
from freqid.gap.locate import EDGES_HZ
from freqid.gap.rivals_cells import Cell, White, white_of
from freqid.gap.rivals_said import ALL, verdict
from freqid.gap.simulation import Simulation
from freqid.gap.weighed import holm, weigh
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

LEVEL = 0.02
"""How often equal simulations are told apart anywhere, unless told otherwise."""

_INTERVAL = float(norm.ppf(0.95))  # standard deviations of a 90 % interval
_LEAST = 0.01  # of the farther one's explainable energy: what is nearer by less is not worth a name
_FEWEST = 2  # lines of a contest


def compare_two(
    pair: tuple[Simulation, Simulation],
    maneuvers: Sequence[Maneuver],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    band_hz: tuple[float, float],
    *,
    level: float = LEVEL,
    count: int = 200,
    seed: int = 0,
    names: Sequence[str] = (),
    tell: Callable[[str], None] = lambda _: None,
) -> Rivals:
    """Compare two simulations on the same flights.

    Parameters
    ----------
    pair : tuple of 2 Simulation
        A and B; where they predict different responses, those in common are compared.
    maneuvers : sequence of Maneuver
    library : dict of Effect
        Whose parameters may be a little off.
    sizes : dict of float
        Tolerances, of `tolerance.stated`.
    band_hz : tuple of 2 floats
    level : float
        How often equal simulations may be told apart anywhere.
    count : int
        Draws of the sensors' noise.
    seed : int
    names : sequence of str
        Of the manoeuvres.
    tell : callable, optional
        Called with what is being done.

    Raises
    ------
    UsageError
        Where the two have no response in common.
    DataError
        Where a record lacks a channel that one of them needs.
    """
    names = list(names) or [f"manoeuvre {i + 1}" for i in range(len(maneuvers))]
    found = []
    for i, (maneuver, name) in enumerate(zip(maneuvers, names, strict=True)):
        tell(f"comparing {name} ({i + 1} of {len(names)})")
        try:
            found.append(beside(pair, maneuver, library, sizes, band_hz, count=count, seed=seed + 1000 * i))
        except DataError as error:
            raise DataError(str(error), where=name) from None
    tell("weighing")
    judged = judge(found, level)
    titles = (pair[0].name, pair[1].name)
    made = replace(judged, simulations=titles, records=tuple(names), remarks=tuple(_remarks(pair, found)))
    return replace(made, verdict=verdict(made))


def judge(compared: Sequence[Beside], level: float = LEVEL) -> Rivals:
    """Return the contests of two simulations: one over all, and by response, band and regime.

    Half of the level goes to the one over all, half to the others together, by Holm's procedure.
    """
    overall = _contest((ALL, _span(compared), ALL), white_of(compared))
    contests = [_contest((c.response, c.band_hz, c.regime), white_of(compared, c)) for c in _cells(compared)]
    adjusted = np.minimum(2 * holm([c.p for c in contests]), 1.0)
    overall = _decided(overall, min(2 * overall.p, 1.0), level)
    contests = [_decided(c, float(p), level) for c, p in zip(contests, adjusted, strict=True)]
    identical = all(np.array_equal(*b.left) for b in compared)
    return Rivals("", ("A", "B"), (), level, identical, overall, tuple(contests))


def _contest(place: tuple[str, tuple[float, float], str], white: White) -> Contest:
    w = weigh(white.a, white.b, white.allowed, *white.noise, white.floor, white.shared)
    energy_a, energy_b = (q - n for q, n in zip(w.squares, w.noise, strict=True))
    reach = _INTERVAL * w.deviation
    same = not (white.a - white.b).any()
    z = abs(w.difference) / w.deviation if w.deviation > 0 else np.inf
    farther = max(energy_a, energy_b, abs(w.difference))
    return Contest(
        response=place[0],
        band_hz=place[1],
        regime=place[2],
        count=w.count,
        maneuvers=white.maneuvers,
        misfit_a=_misfit(energy_a, w.count),
        misfit_b=_misfit(energy_b, w.count),
        energy_a=energy_a,
        energy_b=energy_b,
        difference=Span(w.difference, w.difference - reach, w.difference + reach),
        less=0.0 if same else abs(w.difference) / max(farther, 1e-300),
        p=1.0 if same else float(2 * norm.sf(z)),
        p_adjusted=1.0,
        nearer="",
    )


def _misfit(energy: float, count: int) -> Span:
    """Return explainable energy by white number, with its interval: noise is beside it, numbers are few."""
    reach = _INTERVAL * float(np.sqrt(2 * count + 4 * max(energy, 0.0)))
    return Span(energy / count, (energy - reach) / count, (energy + reach) / count)


def _decided(contest: Contest, adjusted: float, level: float) -> Contest:
    clear = adjusted < level and contest.less >= _LEAST
    nearer = ("B" if contest.difference.value > 0 else "A") if clear else ""
    return replace(contest, p_adjusted=adjusted, nearer=nearer)


def _cells(compared: Sequence[Beside]) -> Iterator[Cell]:
    """Yield responses as a whole, and in bands and regimes, where the two simulations differ."""
    low, top = _span(compared)
    bands = tuple(pairwise([low, *(e for e in EDGES_HZ if low < e < top), top]))
    regimes = dict.fromkeys(b.regime for b in compared)
    for response in dict.fromkeys(name for b in compared for name in b.names):
        cells = [Cell(response, band, regime, band[0] == low) for regime in regimes for band in bands]
        found = [cell for cell in cells if _differs(compared, cell)]
        yield from [Cell(response, (low, top), ALL, True)] if len(found) > 1 else []
        yield from found


def _differs(compared: Sequence[Beside], cell: Cell) -> bool:
    at = [(b, *found) for b in compared if (found := cell.of(b))]
    differ = any((b.left[0][i, m] != b.left[1][i, m]).any() for b, i, m in at)
    return differ and sum(int(m.sum()) for _, _, m in at) >= _FEWEST


def _span(compared: Sequence[Beside]) -> tuple[float, float]:
    hz = [b.lines.hz for b in compared]
    return min(float(h[0]) for h in hz), max(float(h[-1]) for h in hz)


def _remarks(pair: tuple[Simulation, Simulation], compared: Sequence[Beside]) -> list[str]:
    """Return what one of the two does not predict, and so is not compared."""
    said, both = [], set().union(*(b.names for b in compared))
    for label, simulation, other in (("A", pair[0], "B"), ("B", pair[1], "A")):
        alone = [n for n in simulation.responses if n not in both]
        if alone:
            said.append(f"{label} alone predicts {', '.join(alone)}: not compared, {other} does not")
    return said

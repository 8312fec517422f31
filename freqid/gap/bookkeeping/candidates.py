"""Which mistakes are tried on the records at hand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import COEFFICIENT, WRENCH
from freqid.gap.bookkeeping.comparison import Comparison
from freqid.gap.bookkeeping.correction import gain_of
from freqid.gap.bookkeeping.fault import Bench, Fault
from freqid.gap.bookkeeping.inputs import inputs
from freqid.gap.bookkeeping.outputs import outputs
from freqid.gap.connect.differences import moved

Array = NDArray[np.float64]

SEA_LEVEL = 1.225  # kg/m3
_CONFIRMED = 10  # candidates by derivatives that are tried on the simulation itself
_DELAYS = np.concatenate([-np.arange(0.1, 1.01, 0.02), np.arange(0.1, 1.01, 0.02)])  # s


def candidates(comparisons: Sequence[Comparison]) -> Iterator[Fault]:
    """Yield the mistakes that are tried; those in what goes in are ranked by derivatives along a record."""
    first = comparisons[0]
    # the same mistake is made of every record by its own closure where it uses the record's signals
    yield from _of_every(comparisons, [list(outputs(t.bench)) for t in comparisons])
    yield from _shifts(comparisons)
    yield from _ignored_density(first)
    ranked = []
    for fault in inputs(first.bench):
        guess = first.linear(fault)
        if guess is not None:
            ranked.append((gain_of([first], [guess]), fault))
    large = [f for _, f in ranked if f.id in ("degrees", "units", "axes") and " " in f.subject]  # not linear
    small = sorted((r for r in ranked if r[1] not in large), key=lambda r: -r[0])
    yield from (f for gain, f in small[:_CONFIRMED] if gain > 0)
    if first.simulation.kind != "predictions":
        yield from large


def _of_every(comparisons: Sequence[Comparison], lists: Sequence[Sequence[Fault]]) -> Iterator[Fault]:
    """Join the same mistake of several records into one that knows which record it is asked about."""
    by_key = [{(f.id, f.subject, f.sentence): f for f in faults} for faults in lists]
    for key, fault in by_key[0].items():
        if all(key in found for found in by_key):
            mine = {id(t.bench): found[key] for t, found in zip(comparisons, by_key, strict=True)}

            def undo(predicted: Array, bench: Bench, mine: dict = mine) -> Array:
                return mine[id(bench)].undo(predicted, bench)

            yield Fault(fault.id, fault.subject, fault.sentence, fault.remedy, fault.rows, undo=undo)


def _ignored_density(comparison: Comparison) -> Iterator[Fault]:
    """Yield a density that stays that of sea level, where the prediction does not change with it."""
    record = comparison.bench.record
    if "air/rho" not in record or comparison.simulation.kind == "predictions":
        return
    there, denser = (
        comparison.simulation.predict(r)
        for r in (record, moved(record, "air/rho", 0.1 * record["air/rho"].mean()))
    )
    if np.abs(denser - there).max() < 1e-3 * np.abs(there).max():
        yield Fault(
            "density",
            "rho",
            "the density of the record is not used: loads are those of sea level",
            "use air['rho'], or qbar",
            tuple(range(len(comparison.bench.names))),
            undo=lambda p, bench: p * bench.record["air/rho"] / SEA_LEVEL,
        )


def _shifts(comparisons: Sequence[Comparison]) -> Iterator[Fault]:
    """Yield the one shift of all responses together that leaves least."""
    names = comparisons[0].bench.names
    least = 0.1 if sum(n in WRENCH or n in COEFFICIENT for n in names) >= 3 else 0.25

    def left(delay: float) -> float:
        return sum(
            float((t.residual(_shifted(t.predicted, t.bench.record.dt, delay))[0] ** 2).sum())
            for t in comparisons
        )

    best = min((float(d) for d in _DELAYS if abs(d) >= least), key=left)
    how = "early" if best > 0 else "late"
    yield Fault(
        "time_shift",
        " ".join(names),
        f"all responses come {abs(best):.2f} s too {how}",
        "bring the simulation and the record to one clock",
        tuple(range(len(names))),
        undo=lambda p, bench: _shifted(p, bench.record.dt, best),
    )


def _shifted(values: Array, dt: float, delay: float) -> Array:
    """Return rows a time later, s; the ends are held."""
    at = np.arange(values.shape[1], dtype=float)
    return np.array([np.interp(at - delay / dt, at, row) for row in values])

"""``freqid diagnose-gap`` with two simulations: which is nearer to the flights."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freqid import __version__
from freqid.cli import options

if TYPE_CHECKING:
    from freqid.core.record import FlightRecord
    from freqid.core.results.rivals import Contest, Rivals
    from freqid.core.scenario import Scenario
    from freqid.gap.simulation import Simulation
    from freqid.simulate.effects.effect import Effect

_LISTED = 12  # contests


@dataclass(frozen=True)
class Asked:
    """How simulations are compared: scenario, effects, stated tolerances, band, level and seed."""

    described: Scenario | None
    candidates: Mapping[str, Effect]
    tolerances: Mapping[str, float]
    band_hz: tuple[float, float] | None
    level: float
    seed: int


def rivals(
    sims: Sequence[str], predictions: tuple[Path, ...], holdout: Sequence[Path], named: Sequence[str]
) -> list[tuple[str | None, tuple[Path, ...]]]:
    """Return two simulations as `connect` takes them; nothing where one is asked about.

    Raises
    ------
    UsageError
        For more than two, or for what is asked of one simulation alone.
    """
    from freqid.core.errors import UsageError

    found: list[tuple[str | None, tuple[Path, ...]]] = [(s, ()) for s in sims]
    if predictions:
        found.append((None, predictions))
    if len(found) < 2:
        return []
    if len(found) > 2:
        raise UsageError(f"{len(found)} simulations are given", remedy="compare two at a time")
    if holdout:
        raise UsageError(
            "--holdout is for closures, and two simulations are compared as they are",
            remedy="name all flights as records",
        )
    if named:
        raise UsageError(
            "--effect is for one simulation, and two are given",
            remedy="diagnose each by itself with --effect",
        )
    return found


def run(
    pair: tuple[Simulation, Simulation],
    records: Sequence[FlightRecord],
    names: Sequence[str],
    asked: Asked,
    destination: Path,
    drawn: Path | None,
    sources: Mapping[str, Any],
    json_: bool,
    tell: Callable[[str], None],
) -> None:
    """Compare two simulations on records, write the result and its page, and print it."""
    from freqid.compare.two_simulations import compare_two
    from freqid.core.results.rivals import write_rivals
    from freqid.gap import flights
    from freqid.gap.bookkeeping.check import check

    stated = asked.described.aircraft() if asked.described else None
    remarks: list[str] = []
    every = []
    for label, simulation in zip("AB", pair, strict=True):
        vehicle = flights.vehicle_of(records, next((s for s in pair if s.vehicle), simulation), stated)
        found = flights.maneuvers(records, names, simulation, vehicle)
        every = every or found
        tell(f"looking for mistakes of bookkeeping in {label}")
        faults = check(simulation, [m.record for m in found], vehicle)
        remarks += [f"{label}: bookkeeping, not physics: {f.sentence}; {f.remedy}" for f in faults]
        remarks += [f"{label}: {said}" for said in flights.differing(found, simulation)]
    band = asked.band_hz or flights.injected_band(records)
    compared = compare_two(
        pair,
        every,
        names,
        asked.candidates,
        asked.tolerances,
        band,
        level=asked.level,
        seed=asked.seed,
        tell=tell,
    )
    provenance = {
        "A": {"simulation": pair[0].name, "kind": pair[0].kind},
        "B": {"simulation": pair[1].name, "kind": pair[1].kind},
        "records": list(names),
        **sources,
        "band_hz": list(band),
        "level": asked.level,
        "seed": asked.seed,
        "tolerances": dict(asked.tolerances),
        "freqid_version": __version__,
    }
    compared = replace(compared, remarks=(*remarks, *compared.remarks), provenance=provenance)
    write_rivals(destination, compared, str(sources.get("scenario", {}).get("sha256", "")))
    if drawn:
        from freqid.report.gap.rivals_page import build_rivals_page
        from freqid.report.kit.rendering import write_text

        tell("drawing")
        write_text(drawn, build_rivals_page(compared))
    tell("")
    table = compared.to_json() | {"file": str(destination), "page": str(drawn or "")}
    text = rivals_text(compared) + f"\n\n{destination}" + (f"\n{drawn}" if drawn else "")
    options.emit(json_, table, text)


def rivals_text(found: Rivals) -> str:
    """Return the comparison: its verdict in one line first, then a table, then remarks."""
    from freqid.cli.columns import table

    blocks = [found.verdict]
    if not found.identical:
        ranked = sorted(found.contests, key=lambda c: (c.p_adjusted, c.p))
        listed = [c for c in ranked if c.nearer] or ranked
        rows = [_row(c) for c in (found.overall, *listed[:_LISTED])]
        head = ("response", "band", "regime", "misfit A", "misfit B", "nearer", "less", "manoeuvres", "p")
        more = len(listed) - _LISTED
        rest = f"\n  and {more} more in the file" if more > 0 else ""
        blocks.append(
            "Misfit: squared residual over noise and tolerances, less what noise makes; 0 is noise. p is for "
            f"all contests together (level {found.level:g}); a difference of less than "
            f"{100 * found.smallest_difference:g} % is not called.\n" + table(head, rows) + rest
        )
    if found.remarks:
        blocks.append("\n".join(f"Note: {remark}." for remark in found.remarks))
    return "\n\n".join(blocks)


def _row(c: Contest) -> tuple[str, ...]:
    return (
        c.response,
        f"{c.band_hz[0]:.2g}-{c.band_hz[1]:.2g} Hz",
        c.regime,
        f"{c.misfit_a.value:.2g} ({c.misfit_a.lo:.2g} to {c.misfit_a.hi:.2g})",
        f"{c.misfit_b.value:.2g} ({c.misfit_b.lo:.2g} to {c.misfit_b.hi:.2g})",
        c.nearer or "-",
        f"{100 * c.less:.0f} %" if c.nearer else "-",
        str(c.maneuvers),
        f"{c.p_adjusted:.2g}",
    )

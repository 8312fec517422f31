"""The test card of a design: one printed page, and the same as plain text."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from freqid import __version__
from freqid.core.channels import AIR, RESPONSE, STATE
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.design.classic import Extent
from freqid.design.multisine.merit import Merit
from freqid.report.design.flight_plan import EMPTY, FlightPlan, intrusions, power_in_band
from freqid.report.kit.effectors import effector_groups, engineering, reach
from freqid.report.kit.notation import measured_values, number, percent, pretty_unit, short, shown_unit
from freqid.report.kit.rendering import render, write_text

LEVELS = (0.25, 0.5, 0.75, 1.0)
BLANK = "_______"
NOT_PREDICTED = "not predicted: no model given"
# What is watched where nobody says what: attitude, rates, airspeed.
_WATCHED = ("phi", "theta", "p", "q", "r", "V")
_WIDTH = 92  # columns of the plain text: A4 upright at 10 points


@dataclass(frozen=True)
class CardRow:
    """One line of a table of the card.

    Attributes
    ----------
    label, unit : str
    cells : tuple of str
        One for each build-up level, or a single one that stands for all.
    limit : str
    missed : tuple of bool
        Which cells are beyond the limit; as many as `cells`.
    """

    label: str
    unit: str
    cells: tuple[str, ...]
    limit: str
    missed: tuple[bool, ...]


@dataclass(frozen=True)
class Card:
    """What both forms of the card say.

    Attributes
    ----------
    title : str
    facts : tuple of (label, text)
    inputs : tuple of CardRow
        Excitation by group of effectors.
    input_head : str
        What a cell of a group holds.
    motion : tuple of CardRow
        States, and last the time that effectors spend beyond their limits.
    motion_head : str
        What a cell of a state holds.
    motion_note : str
        What the expectation leaves out.
    bands : tuple of (good, text)
        One for each forbidden band.
    """

    title: str
    facts: tuple[tuple[str, str], ...]
    inputs: tuple[CardRow, ...]
    input_head: str
    motion: tuple[CardRow, ...]
    motion_head: str
    motion_note: str
    bands: tuple[tuple[bool, str], ...]


def build_card(design: MultisineDesign | ClassicDesign, merit: Merit | Extent, plan: FlightPlan) -> Card:
    """Collect what a crew needs to fly a design step by step.

    Parameters
    ----------
    design : MultisineDesign or ClassicDesign
    merit : Merit or Extent
        Of that design.
    plan : FlightPlan
        Where a limit or a ramp is missing, the card has a blank to fill in.
    """
    classic = isinstance(design, ClassicDesign)
    spread = any(not math.isnan(e[2]) for e in map(plan.expected, plan.states) if e)
    return Card(
        title=plan.vehicle.name,
        facts=_facts(design, plan),
        inputs=_inputs(design, merit, plan),
        input_head="amplitude" if classic else "rms / peak",
        motion=(*(_state(name, plan) for name in plan.states or _WATCHED), _saturation(plan)),
        motion_head=f"peak ± 1σ of {len(plan.varied)} models" if spread else "rms / peak",
        motion_note="Linear model: gusts come on top."
        if classic
        else "Steady state of a linear model: gusts and the first seconds come on top.",
        bands=tuple(_band(design, band) for band in plan.forbidden_hz),
    )


def write_test_card(path: Path, card: Card) -> None:
    """Write the card as a page that prints on one sheet of A4.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """
    write_text(path, render("test_card.html", card=card, levels=LEVELS, version=__version__, blank=BLANK))


def test_card_text(card: Card) -> str:
    """Return the card as plain text, 92 columns wide at most."""
    head = [f"{100 * level:g} %" for level in LEVELS]
    return render(
        "test_card.txt",
        card=card,
        levels=LEVELS,
        version=__version__,
        blank=BLANK,
        width=_WIDTH,
        facts="\n".join(f"{label:13}" + _wrapped(text, 13) for label, text in card.facts),
        bands="\n".join(_wrapped(text, 2) for _, text in card.bands),
        inputs=_table([("group", "unit", *head, "limit"), *map(_cells, card.inputs)]),
        motion=_table([("", "unit", *head, "limit"), *map(_cells, card.motion)]),
    )


test_card_text.__test__ = False  # type: ignore[attr-defined]  # a card for flight tests, not one of pytest's


def _facts(design: MultisineDesign | ClassicDesign, plan: FlightPlan) -> tuple[tuple[str, str], ...]:
    mass = short(plan.vehicle.mass_properties.mass_kg)
    return (
        ("Aircraft", f"{plan.vehicle.name}, {mass} kg"),
        ("Condition", plan.condition or BLANK),
        ("Control law", plan.control or BLANK),
        ("Design", plan.source or BLANK),
        ("SHA-256", plan.sha256 or BLANK),
        *(_classic_run(design, plan) if isinstance(design, ClassicDesign) else _multisine_run(design, plan)),
    )


def _multisine_run(design: MultisineDesign, plan: FlightPlan) -> tuple[tuple[str, str], ...]:
    lines = np.unique(np.concatenate([s.index for s in design.signals]))
    ramps = tuple(f"{short(s)} s" for s in plan.fade_s) if plan.fade_s else (f"{BLANK} s",) * 2
    return (
        (
            "Inputs",
            f"{len(design.signals)} effectors at once, {lines.size} harmonics, "
            f"{short(lines[0] / design.period_s)} to {short(lines[-1] / design.period_s)} Hz",
        ),
        (
            "Each run",
            f"{design.periods} × {short(design.period_s)} s = {short(design.duration_s)} s; "
            f"ramp in {ramps[0]}, ramp out {ramps[1]}",
        ),
    )


def _classic_run(design: ClassicDesign, plan: FlightPlan) -> tuple[tuple[str, str], ...]:
    low, high = design.band_hz
    what = f"sweep, {short(low)} to {short(high)} Hz" if design.waveform == "sweep" else design.waveform
    order = ", ".join(effector_groups(design.names, plan.vehicle))
    return (
        ("Inputs", f"{what}: {len(design.names)} effectors, one after the other: {order}"),
        ("Each run", f"{design.periods} times all effectors, {short(design.duration_s)} s"),
    )


def _inputs(
    design: MultisineDesign | ClassicDesign, merit: Merit | Extent, plan: FlightPlan
) -> tuple[CardRow, ...]:
    rows = []
    for label, places in effector_groups(design.names, plan.vehicle).items():
        unit, factor = engineering(design.units[places[0]])
        rms, peak = factor * merit.rms[places].max(), factor * merit.peak[places].max()
        rooms = [reach(plan.vehicle, design.names[i], plan.trim) for i in places]
        known = [factor * min(-room[0], room[1]) for room in rooms if room is not None]
        limit = min(known) if len(known) == len(rooms) else math.inf
        rows.append(
            CardRow(
                label,
                pretty_unit(unit),
                tuple(
                    number(level * peak)
                    if isinstance(design, ClassicDesign)
                    else f"{number(level * rms)} / {number(level * peak)}"
                    for level in LEVELS
                ),
                f"±{short(limit)}" if math.isfinite(limit) else "trim not given",
                tuple(level * peak > limit for level in LEVELS),
            )
        )
    return tuple(rows)


def _state(name: str, plan: FlightPlan) -> CardRow:
    si = {**STATE, **AIR, **RESPONSE}.get(name, ("1",))[0]
    if plan.motion is not None and name in plan.motion.names:
        si = plan.motion.units[plan.motion.names.index(name)]
    unit, factor = shown_unit(f"state/{name}", si)
    abort = factor * plan.abort[name] if name in plan.abort else math.inf
    limit = f"±{short(abort)}" if math.isfinite(abort) else BLANK
    found = plan.expected(name)
    if found is None:
        why = NOT_PREDICTED if plan.motion is None else "not predicted: the model does not have it"
        return CardRow(name, pretty_unit(unit), (why,), limit, (False,))
    rms, peak, spread = (factor * value for value in found)
    if math.isnan(spread):
        cells = tuple(f"{number(level * rms, 2)} / {number(level * peak, 2)}" for level in LEVELS)
        spread = 0.0
    else:
        cells = tuple(" ± ".join(measured_values(level * spread, level * peak)[::-1]) for level in LEVELS)
    missed = tuple(level * (peak + spread) > abort for level in LEVELS)
    return CardRow(name, pretty_unit(unit), cells, limit, missed)


def _saturation(plan: FlightPlan) -> CardRow:
    """Return at each level the share of time that the worst effector is at a limit, and its name."""
    shares = [plan.saturated(level) for level in LEVELS]
    label, unit, limit = "beyond limits", "time", "0 %"
    if not shares[0]:
        why = NOT_PREDICTED if plan.motion is None else "not predicted: no effector with a known trim"
        return CardRow(label, unit, (why,), limit, (False,))
    worst = [max((share, name) for name, share in level.items()) for level in shares]
    cells = tuple(f"{percent(share)} {name}" if share else "0 %" for share, name in worst)
    return CardRow(label, unit, cells, limit, tuple(share > 0 for share, _ in worst))


def _band(design: MultisineDesign | ClassicDesign, band: tuple[float, float]) -> tuple[bool, str]:
    where = f"{short(band[0])} to {short(band[1])} Hz"
    if isinstance(design, ClassicDesign):
        share, name = power_in_band(design, band)
        if share > EMPTY:
            return False, f"{where}: FAIL, {percent(share)} of the power of {name}"
        return True, f"{where}: PASS, less than {percent(EMPTY)} of the power of every effector"
    found = intrusions(design, band)
    if found:
        listing = ", ".join(f"{name} at {short(f)} Hz" for name, f in found[:3])
        more = f" and {len(found) - 3} more" if len(found) > 3 else ""
        return False, f"{where}: FAIL, power of {listing}{more}"
    f = np.concatenate([s.index[s.amplitude != 0] for s in design.signals]) / design.period_s
    nearest = float(f[np.argmin(np.maximum(band[0] - f, f - band[1]))])
    return True, f"{where}: PASS, empty; the nearest line is at {short(nearest)} Hz"


def _wrapped(text: str, indent: int) -> str:
    """Return a text in lines that fit beside or below what stands in its first `indent` columns."""
    return f"\n{' ' * indent}".join(textwrap.wrap(text, _WIDTH - indent))


def _cells(row: CardRow) -> tuple[str, ...]:
    marked = (cell + ("!" if bad else "") for cell, bad in zip(row.cells, row.missed, strict=True))
    return (row.label, row.unit, *marked, row.limit)


def _table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of texts as aligned columns; a row of four has one text over all levels."""
    flat = [[" ".join(cell.split()) for cell in row] for row in rows]
    count = len(flat[0])
    widths = [max(len(row[j]) for row in flat if len(row) == count) for j in range(count)]
    widths[:2] = [max(len(row[j]) for row in flat) for j in range(2)]
    over = max((len(row[2]) for row in flat if len(row) < count), default=0)
    widths[-2] += max(0, over - sum(widths[2:-1]) - 2 * (count - 4))
    spread = sum(widths[2:-1]) + 2 * (count - 4)
    lines = []
    for row in flat:
        columns = widths if len(row) == count else [*widths[:2], spread, widths[-1]]
        lines.append("  ".join(cell.ljust(width) for cell, width in zip(row, columns, strict=True)).rstrip())
    return "\n".join(lines)

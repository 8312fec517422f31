"""What to do next after a diagnosis, as the terminal shows it and as a design file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from freqid.core.scenario import Scenario
    from freqid.gap.diagnose import Findings, Question
    from freqid.gap.simulation import Simulation

_LISTED = 5  # tests


def beside(destination: Path) -> Path:
    """Return where the next flight's design goes."""
    return destination.with_name(f"{destination.stem}-next.h5")


def with_next_test(
    found: Findings,
    simulation: Simulation,
    question: Question,
    scenario: Scenario | None,
    destination: Path,
    scenario_sha256: str,
    tell: Callable[[str], None],
) -> Findings:
    """Return findings with what to do next; the flight's design is written to `destination`.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """
    from dataclasses import replace

    from freqid.core.design_file import write_design
    from freqid.design.multisine import sampled
    from freqid.gap.next_test import next_test

    proposed = next_test(found, simulation, question, scenario, tell)
    table = dict(proposed.table)
    if proposed.design is not None:
        write_design(destination, proposed.design, sampled(proposed.design), scenario_sha256)
        table["design"] = str(destination)
    return replace(found, diagnosis=replace(found.diagnosis, next_flight=table))


def next_text(table: Mapping[str, Any]) -> str:
    """Return what splits what is left, then the tests, the best first; nothing where nothing is left."""
    if not table:
        return ""
    lines = ["Next:"]
    lines += [f"  {group['sentence']}" for group in table["groups"]]
    for test in table["tests"][:_LISTED]:
        each = [f"{' / '.join(p['rivals'])} {p['now']:.2g} to {p['after']:.3g}" for p in test["pairs"]]
        told = ", ".join(each)
        lines.append(f"  {test['kind']}: {test['how']} (expected separation {told}; 5.4 tells apart)")
    if table["design"]:
        lines.append(f"  designed in {table['design']}")
    return "\n".join(lines)

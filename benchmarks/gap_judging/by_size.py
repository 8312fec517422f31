"""How large a spliced change must be to be found: `python benchmarks/gap_judging/by_size.py results.csv`.

Results are those of run.py on the real cases. Prints Markdown: for each flight and change the smallest size
that was found (called a gap, with the truth or an alias of it in the stated set or named) and the largest
that was not; before it, by flight, the errors of form that the diagnosis learned. A case without an answer is
not found.
"""

from __future__ import annotations

import argparse
import re
import statistics
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from table import Outcome, _loaded, rate, read_outcomes

SPLICED = re.compile(r"(?P<change>.+)_(?P<size>m?\d+(?:p\d+)?(?:em?\d+)?)(?P<unit>ms|rad|m|)")


@dataclass(frozen=True)
class Trial:
    """One spliced case.

    Attributes
    ----------
    flight : str
        Aircraft and flights that were judged.
    change : str
        What was spliced, and where.
    effect : str
    size : float
        Signed, in `unit`.
    unit : str
    found, called : bool
    """

    flight: str
    change: str
    effect: str
    size: float
    unit: str
    found: bool
    called: bool

    @classmethod
    def of(cls, outcome: Outcome) -> Trial | None:
        """Return the trial of a row; None where nothing of a stated size was spliced."""
        flight, _, label = outcome.raw["case"].rpartition("-")
        match = SPLICED.fullmatch(label)
        if outcome.set != "real" or outcome.kind != "single" or match is None:
            return None
        said = outcome.stated.union(*outcome.answers)
        known = any(said & same for same in outcome.same.values())
        size = float(match["size"].replace("m", "-").replace("p", "."))
        return cls(
            flight,
            match["change"],
            outcome.raw["truth"],
            size,
            match["unit"],
            outcome.called and known,
            outcome.called,
        )


def main() -> None:
    """Print both tables for every label of the results."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("results", type=Path, help="CSV file of run.py")
    parser.add_argument("--label", help="only the rows of this label")
    asked = parser.parse_args()
    for label, outcomes in read_outcomes(asked.results).items():
        if asked.label in (None, label):
            print(f"## {label}\n\n{form_table(outcomes)}\n\n{size_table(outcomes)}\n")


def form_table(outcomes: Iterable[Outcome]) -> str:
    """Return by flight whether the untouched case is called a gap, and errors of form."""
    flights: dict[str, dict[str, list[Outcome]]] = {}
    for o in outcomes:
        if o.set == "real" and o.answered:
            flight = o.raw["case"].rpartition("-")[0]
            flights.setdefault(flight, {}).setdefault(o.kind, []).append(o)
    lines = [
        "| flight | untouched is called a gap | error of form, untouched | median of the spliced cases |",
        "|---|---|---|---|",
    ]
    for flight, kinds in sorted(flights.items()):
        nulls, singles = kinds.get("null", []), kinds.get("single", [])
        called = ", ".join("yes" if o.called else "no" for o in nulls)
        lines.append(f"| {flight} | {called} | {_forms(nulls)} | {_forms(singles)} |")
    return "\n".join(lines)


def _forms(outcomes: Iterable[Outcome]) -> str:
    """Return the median error of form of each row, in words; nothing where results have no such column."""
    learned = [_loaded(o.raw.get("form_errors") or "", {}) for o in outcomes]
    learned = [one for one in learned if one]
    rows = dict.fromkeys(row for one in learned for row in one)
    return ", ".join(
        f"{row} {float(f'{100 * statistics.median(one.get(row, 0.0) for one in learned):.2g}'):g} %"
        for row in rows
    )


def size_table(outcomes: Iterable[Outcome]) -> str:
    """Return the smallest size found and the largest not found, by flight and change."""
    groups: dict[tuple[str, str, str], list[Trial]] = {}
    for trial in (Trial.of(o) for o in outcomes):
        if trial is not None:
            groups.setdefault((trial.flight, trial.effect, trial.change), []).append(trial)
    lines = [
        "| flight | effect | change | smallest found | largest missed | missed, yet called a gap | tried |",
        "|---|---|---|---|---|---|---|",
    ]
    for (flight, effect, change), trials in sorted(groups.items()):
        trials.sort(key=lambda t: abs(t.size))
        found = [t for t in trials if t.found]
        missed = [t for t in trials if not t.found]
        cells = [
            flight,
            effect,
            change.replace("_", " "),
            _sized(found[0]) if found else "none",
            _sized(missed[-1]) if missed else "none",
            f"{sum(t.called for t in missed)}/{len(missed)}" if missed else "",
            ", ".join(_sized(t) for t in trials),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    every = [t for trials in groups.values() for t in trials]
    return "\n".join([*lines, "", f"Found: {rate(t.found for t in every)} of the spliced cases."])


def _sized(trial: Trial) -> str:
    return f"{trial.size:g} {trial.unit}".strip()


if __name__ == "__main__":
    main()

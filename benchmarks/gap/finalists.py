"""What is gained by sizes apart and by weighing in full: evidence of truths and of what they are taken for.

    python benchmarks/gap/finalists.py

Two flights of the LA-8 for each truth, everywhere a little off as in the open cases; ``finalists.csv`` beside
this script gets one row a truth. Columns: the cosine of the truth's change with its candidate's, in the
metric of noise and tolerances, with one size, with one for each manoeuvre, and with one for each response
too; the evidence of the candidate and of the strongest other explanation, to first order with one size, to
first order with sizes apart, and with finalists weighed in full.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench import Bench, Circumstances  # first: it finds what lies beside it
from la8_bench import LA8
from provenance import code
from truth import Part

from freqid.gap import attribute
from freqid.gap.attribute import Judged, variants
from freqid.gap.evidence import IN_MANEUVER, IN_ROW, Evidence, Hypothesis
from freqid.gap.finalists import weighed_in_full
from freqid.gap.gather import evidence_of

CSV = Path(__file__).resolve().with_name("finalists.csv")
SEED = 4
TRUTHS = (
    ("actuator_delay", "own", "extra", 0.03),
    ("actuator_delay", "own", "extra", 0.06),
    ("actuator_lag", "damped", "", 0.006),
    ("motor_lag", "slower", "", 0.0127),
    ("wing_wake", "uneven", "-", 0.3),
    ("slipstream", "blown", "-strength", 0.1),
    ("battery_sag", "resistance", "", 0.25),
    ("surface_effectiveness", "cut", "df1", 0.2),
    ("weak_rotor", "worn", "n5", 0.12),
    ("extra_drag", "fuselage", "", 5.0),
    ("rate_limit", "own", "slowness", 1.5),
    ("mass", "own", "fraction", 0.09),
)


def row_of(by: Bench, part: Part) -> dict[str, Any]:
    """Return one truth as a row."""
    how = [Circumstances(noise=1.0, seed=10 * SEED + i, scatter=SEED) for i in range(len(by.at))]
    flights = [by.fly(at, [part], h) for at, h in zip(by.at, how, strict=True)]
    used = [by.measured(f, i, **by.candidates) for i, f in enumerate(flights)]
    change = [by.change(at, [part], c, h) for at, c, h in zip(by.at, used, how, strict=True)]
    beside = [(0 * s, {**c.signatures, "truth": s}) for s, c in zip(change, used, strict=True)]
    seen = evidence_of(used, changes=beside, apart=True, null=False)
    library = {i: e.of(flights[0].vehicle) for i, e in by.candidates.items()}
    effect = library[part.truth.id]
    truth = Hypothesis("truth", (seen.column("truth"),), (1.0,))
    found: dict[str, Any] = {
        "truth": effect.id,
        "form": part.truth.form,
        "place": part.place,
        "size": part.size,
        "lambda": f"{seen.metric[truth.columns[0], truth.columns[0]]:.4g}",
    }
    for label, ways in _ways(seen, variants(effect, seen)).items():
        found[f"cosine_{label}"] = f"{max(seen.alignment(truth, w) for w in ways):.2f}"
    for label, evidence in (("one", evidence_of(used)), ("apart", evidence_of(used, apart=True))):
        judged = attribute.judge(evidence, library)
        found |= _told(f"first_{label}", judged, effect.id)
        if label == "apart":
            found |= _told("full", weighed_in_full(judged, evidence, library, used), effect.id)
    return found | {"code": code()}


def _ways(seen: Evidence, every: Sequence[Hypothesis]) -> dict[str, list[Hypothesis]]:
    """Return the ways of an effect by how many sizes they have."""
    names = {h: [seen.signatures[c - 1] for c in h.columns] for h in every}
    by_row = {h for h in every if any(IN_ROW in n for n in names[h])}
    by_flight = {h for h in every if any(IN_MANEUVER in n for n in names[h])} - by_row
    kinds = {"one": set(every) - by_row - by_flight, "flights": by_flight, "responses": by_row}
    return {label: list(kind) for label, kind in kinds.items() if kind}


def _told(label: str, judged: Sequence[Judged], truth: str) -> dict[str, Any]:
    single = [j for j in judged if "+" not in j.name]
    own = next(j for j in single if j.name == truth)
    other = next(j for j in single if j.name != truth)
    return {
        label: f"{own.evidence:.1f}",
        f"{label}_other": f"{other.evidence:.1f}",
        f"{label}_is": other.name,
    }


def main() -> None:
    rows = []
    for identifier, form, place, size in TRUTHS:
        rows.append(row_of(LA8, Part(LA8.find(identifier, form), place, size)))
        print("  ".join(str(v) for v in rows[-1].values()), flush=True)
    names = list(dict.fromkeys(n for row in rows for n in row))
    with CSV.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n", restval="")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()

"""The table of judging cases: each measure with what it must and should be, one column for each results file.

    python benchmarks/gap_judging/table.py results.csv [more.csv ...] [--last 8] [-o table.md]

Results are those of run.py. A column is named by the file's label. Shares come with their count and their
95 % Wilson interval, means with 1.96 standard errors. Rules that are not in a measure's own line:

- A null that is stopped with a mistake of bookkeeping, or whose sensors are called faulty, is called a gap.
- A single without an answer (an error, the time limit, a stop at bookkeeping) counts as not found. Nulls and
  outsiders without an answer count for nothing and are listed.
- The name that is given is ``which.named`` and the faults of ``sensors``, or the pair, less what was
  withdrawn. Members of one alias group (aliases.py, and the case's own) are one name.
- Where an effect acts: the rows that hold a tenth of the true effect, and those that the diagnosis lists.
- The closure is the leading one, whatever was named; G is taken within 0 and 1.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aliases import equivalent, groups_of, merged, right

STRATA = (15, 50, 200, 1000)
LISTED = 0.1  # share from which a row or an input counts as where the effect is
STEADY = 1.001  # factor by which RMSE may differ without having risen
LEAST_G = 0.1  # an oracle's G below this says nothing of a closure
NO_INPUT = ("", "none", "steady")  # lines that no injected signal drives


@dataclass(frozen=True)
class Outcome:
    """One case and what the diagnosis made of it.

    Attributes
    ----------
    vehicle, set, kind : str
    stratum : int
        0 where the case states none.
    faintest : float
        Detectability of the fainter effect; NaN where it is not stated.
    answered : bool
        Whether there is a diagnosis.
    stopped : bool
        Whether it stopped at a mistake of bookkeeping.
    called : bool
        Whether it says that there is a gap.
    same : dict of frozenset of str
        By true effect, the ids that count as its name.
    answers : list of frozenset of str
        Names that were given, members of an alias group together.
    pair : bool
        Whether they were given as acting together.
    stated : set of str
        The set that should hold the truth.
    probabilities : dict of float
    true_rows, true_inputs, rows, inputs : dict of float
        Shares.
    raw : dict of str
        The row of the results file.
    """

    vehicle: str
    set: str
    kind: str
    stratum: int
    faintest: float
    answered: bool
    stopped: bool
    called: bool
    same: dict[str, frozenset[str]]
    answers: list[frozenset[str]]
    pair: bool
    stated: set[str]
    probabilities: dict[str, float]
    true_rows: dict[str, float]
    true_inputs: dict[str, float]
    rows: dict[str, float]
    inputs: dict[str, float]
    raw: dict[str, str]

    @classmethod
    def of(cls, row: dict[str, str]) -> Outcome:
        """Return the outcome of a row of a results file."""
        words = _loaded(row["words"], {})
        groups = groups_of(_loaded(row["case_aliases"], []), words)
        withdrawn = set(_loaded(row["withdrawn"], {}))
        faults = [text.split()[0] for text in _loaded(row["sensors"], [])]
        pair = row["pair"].split()
        names = [n for n in (pair or row["named"].split()) + faults if n not in withdrawn]
        lam = _loaded(row["lambda"], {}).values()
        same = equivalent(words, groups, _loaded(row.get("named_moved", ""), {}))
        return cls(
            vehicle=row["vehicle"],
            set=row["set"],
            kind=row["kind"],
            stratum=int(float(row["stratum"] or 0)),
            faintest=min(lam, default=math.nan),
            answered=row["exists"] != "",
            stopped=row["exists"] == "" and bool(row["bookkeeping"]),
            called=row["exists"] == "1" or bool(faults),
            same=same,
            answers=merged(names, groups, same),
            pair=len(pair) > 1 and not set(pair) & withdrawn,
            stated=set(row["set_stated"].split()),
            probabilities=_loaded(row["probabilities"], {}),
            true_rows=_loaded(row["true_rows"], {}),
            true_inputs=_loaded(row["true_inputs"], {}),
            rows=_loaded(row["where_rows"], {}),
            inputs=_loaded(row["where_inputs"], {}),
            raw=row,
        )

    @property
    def strength(self) -> float:
        """Detectability for which the case was made; NaN where none is stated."""
        return float(self.stratum) if self.stratum else self.faintest

    @property
    def placed(self) -> bool | None:
        """Whether a single right name has the true channel or place; None where either is not stated."""
        stated = _loaded(self.raw["named_words"], {})
        for effect, words in _loaded(self.raw["words"], {}).items():
            if words and stated.get(effect):
                return not set(words).isdisjoint(stated[effect])
        return None

    @property
    def right(self) -> bool:
        """Whether exactly the true effects were named."""
        return right(self.same, self.answers)

    def chance(self, merge: bool) -> float | None:
        """Return the probability on the truth, with its aliases if `merge`; None without probabilities."""
        if not self.probabilities:
            return None
        truths = frozenset().union(*self.same.values()) if merge else frozenset(self.same)
        return sum(self.probabilities.get(i, 0.0) for i in truths)

    def number(self, column: str) -> float:
        """Return a column as a number; NaN where it is empty."""
        return float(self.raw[column] or "nan")


Outcomes = Sequence[Outcome]


@dataclass(frozen=True)
class Measure:
    """One line of the table.

    Attributes
    ----------
    name, must, want : str
    of : callable
        What it is on the outcomes of one results file, in words.
    """

    name: str
    must: str
    want: str
    of: Callable[[Outcomes], str]


def main() -> None:
    """Print the table, and write it where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("results", nargs="+", type=Path, help="CSV files of run.py")
    parser.add_argument("-o", "--output", type=Path, help="Markdown file")
    parser.add_argument(
        "--last", type=int, help="labels beside the first one, the last ones; all where absent"
    )
    asked = parser.parse_args()
    columns = {name: rows for path in asked.results for name, rows in read_outcomes(path).items()}
    first, *others = columns
    text = table({name: columns[name] for name in (first, *others[-(asked.last or len(others)) :])})
    print(text)
    if asked.output:
        asked.output.write_text(text + "\n", encoding="utf-8")


def read_outcomes(path: Path) -> dict[str, list[Outcome]]:
    """Return the outcomes of a results file by label; the file's name stands for an empty label."""
    found: dict[str, list[Outcome]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            found.setdefault(row["label"] or path.stem, []).append(Outcome.of(row))
    return found


def table(columns: dict[str, list[Outcome]]) -> str:
    """Return the Markdown table of several runs side by side.

    Parameters
    ----------
    columns : dict of list of Outcome
        By label.
    """
    every = [o for outcomes in columns.values() for o in outcomes]
    vehicles = sorted({o.vehicle for o in every if o.set != "real"})
    lines = [
        "| measure | must | want | " + " | ".join(columns) + " |",
        "|" + "---|" * (3 + len(columns)),
    ]
    for measure in measures(vehicles):
        cells = [measure.of(outcomes) for outcomes in columns.values()]
        if any(c != "no cases" for c in cells):
            lines.append(f"| {measure.name} | {measure.must} | {measure.want} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def measures(vehicles: Sequence[str]) -> list[Measure]:
    """Return the lines of the table.

    Parameters
    ----------
    vehicles : sequence of str
        Of the generated cases; each gets lines of its own.
    """
    found = [Measure("cases: nulls, singles, pairs, outsiders; generated + real", "", "", _counts)]
    found.append(
        Measure("called a gap on nulls, generated", "<= 3 %", "<= 1 %", lambda o: _false(_made(o, "null")))
    )
    found += [
        Measure(f"... {v}", "", "", lambda o, v=v: _false([x for x in _made(o, "null") if x.vehicle == v]))
        for v in vehicles
    ]
    found.append(
        Measure("... given a name", "", "", lambda o: rate(bool(x.answers) for x in _heard(_made(o, "null"))))
    )
    found.append(
        Measure("called a gap on real nulls", "<= 5 %", "<= 2 %", lambda o: _false(_real(o, "null")))
    )
    found.append(
        Measure("... given a name", "", "", lambda o: rate(bool(x.answers) for x in _heard(_real(o, "null"))))
    )
    limits = {15: (">= .7", ">= .85"), 50: (">= .85", ">= .95"), 200: (">= .95", "1"), 1000: ("", "")}
    for s in STRATA:
        of = {"": lambda x: True} | {f", {v}": lambda x, v=v: x.vehicle == v for v in vehicles}
        for name, holds in of.items():
            found.append(
                Measure(
                    f"detection at lambda {s}, share of the ideal scan's" if not name else f"...{name[1:]}",
                    *(limits[s] if not name else ("", "")),
                    lambda o, s=s, holds=holds: _detection(
                        [x for x in _made(o, "single") if x.stratum == s and holds(x)]
                    ),
                )
            )
    found.append(Measure("detection, real singles", "", "", lambda o: _detection(_real(o, "single"))))
    found.append(Measure("right name when a single name is given", ">= 95 %", ">= 98 %", _right_name))
    found += [
        Measure(
            f"... at lambda {s}",
            "",
            "",
            lambda o, s=s: _right_name([x for x in o if x.stratum == s and x.set != "real"]),
        )
        for s in STRATA
    ]
    found.append(
        Measure("... generated", "", "", lambda o: _right_name([x for x in o if x.set != "real"])),
    )
    found.append(Measure("... real", "", "", lambda o: _right_name([x for x in o if x.set == "real"])))
    found += [
        Measure(
            "... right names whose channel or place is right too, where both are stated", "", "", _placed
        ),
        Measure(
            "a single name is given, of singles found",
            "",
            "",
            lambda o: rate(len(x.answers) == 1 and not x.pair for x in _found(o)),
        ),
        Measure("a pair is given, of singles found", "", "", lambda o: rate(x.pair for x in _found(o))),
        Measure("truth in the stated set, singles found", "88-95 %", "90-93 %", _covered),
        Measure("... generated", "", "", lambda o: _covered([x for x in o if x.set != "real"])),
        Measure("... real", "", "", lambda o: _covered([x for x in o if x.set == "real"])),
        Measure("outsiders given a wrong name", "<= 15 %", "<= 8 %", _misnamed),
        Measure(
            "mean probability on the truth, lambda >= 50", ">= .75", ">= .85", lambda o: _chance(o, False)
        ),
        Measure("... with its aliases", "", "", lambda o: _chance(o, True)),
        Measure(
            "... real singles, with aliases",
            "",
            "",
            lambda o: mean(x.chance(True) or 0.0 for x in _real(o, "single")),
        ),
        Measure(
            "rows located, F1, singles found",
            ">= .85",
            ">= .92",
            lambda o: mean(f1(x.true_rows, x.rows) for x in _found(o)),
        ),
        Measure(
            "inputs located, F1, singles found",
            ">= .85",
            ">= .92",
            lambda o: mean(f1(x.true_inputs, x.inputs) for x in _found(o)),
        ),
        Measure("closure G over the oracle's, lambda >= 50", ">= .85", ">= .95", _closure),
        Measure("... G itself, within 0 and 1", "", "", _mean_g),
        Measure("... G above 1 printed", "0", "0", lambda o: rate(x.number("G") > 1 for x in _closed(o))),
        Measure("pairs, both right, lambda >= 200 each", ">= 75 %", ">= 90 %", _pairs),
        Measure("... one of them named, nothing else", "", "", _half_pairs),
        Measure("names given while the held-out log score falls or RMSE rises", "0", "0", _unearned),
        Measure("... of them with RMSE or log score stated", "", "", _judged),
        Measure(
            "seconds, generated, median (90 % of cases below)",
            "<= 20",
            "<= 8",
            lambda o: _seconds([x for x in o if x.set != "real"]),
        ),
        Measure("... real", "", "", lambda o: _seconds([x for x in o if x.set == "real"])),
        Measure("without an answer", "", "", lambda o: rate(not (x.answered or x.stopped) for x in o)),
        Measure("stopped at bookkeeping", "", "", lambda o: rate(x.stopped for x in o)),
    ]
    return found


def wilson(count: int, n: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of a share."""
    share, z = count / n, 1.959964
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * math.sqrt(share * (1 - share) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def rate(flags: Iterable[Any]) -> str:
    """Return a share, its count and its 95 % Wilson interval, in words."""
    values = [bool(f) for f in flags]
    if not values:
        return "no cases"
    lo, hi = wilson(sum(values), len(values))
    share = sum(values) / len(values)
    return f"{100 * share:.0f} % ({sum(values)}/{len(values)}) [{100 * lo:.0f}, {100 * hi:.0f}]"


def mean(values: Iterable[float | None]) -> str:
    """Return a mean with 1.96 standard errors and its count, in words; None and NaN are left out."""
    known = [v for v in values if v is not None and v == v]
    if not known:
        return "no cases"
    if len(known) == 1:
        return f"{known[0]:.2f} (n 1)"
    error = 1.96 * statistics.stdev(known) / math.sqrt(len(known))
    return f"{statistics.mean(known):.2f} +- {error:.2f} (n {len(known)})"


def f1(truth: dict[str, float], found: dict[str, float]) -> float | None:
    """Return the F1 score of places that hold a tenth; None where none does in truth."""
    a, b = ({n for n, x in t.items() if x >= LISTED and n not in NO_INPUT} for t in (truth, found))
    return 2 * len(a & b) / (len(a) + len(b)) if a else None


def _made(outcomes: Outcomes, kind: str) -> list[Outcome]:
    return [o for o in outcomes if o.kind == kind and o.set != "real"]


def _real(outcomes: Outcomes, kind: str) -> list[Outcome]:
    return [o for o in outcomes if o.kind == kind and o.set == "real"]


def _heard(outcomes: Outcomes) -> list[Outcome]:
    return [o for o in outcomes if o.answered or o.stopped]


def _found(outcomes: Outcomes) -> list[Outcome]:
    """Return singles whose gap was called one."""
    return [o for o in outcomes if o.kind == "single" and o.called]


def _strong(outcomes: Outcomes, least: float) -> list[Outcome]:
    return [o for o in outcomes if o.strength >= least]


def _counts(outcomes: Outcomes) -> str:
    kinds = ("null", "single", "pair", "outsider")
    made, real = (
        ", ".join(str(sum(o.kind == k and (o.set == "real") == r for o in outcomes)) for k in kinds)
        for r in (False, True)
    )
    return f"{made} + {real}"


def _false(nulls: Outcomes) -> str:
    return rate(o.called or o.stopped for o in _heard(nulls))


def _detection(singles: Outcomes) -> str:
    """Return the rate of detection, and its share of the ideal scan's where cases have one."""
    if not singles:
        return "no cases"
    said = rate(o.called for o in singles)
    ideal = [o for o in singles if o.raw["ideal_found"] != ""]
    if not ideal:
        return said
    best = sum(o.raw["ideal_found"] == "1" for o in ideal)
    share = sum(o.called for o in ideal) / best if best else math.nan
    return f"{share:.2f}: {said}, ideal {best}/{len(ideal)}"


def _right_name(outcomes: Outcomes) -> str:
    single = [o for o in outcomes if o.kind == "single" and len(o.answers) == 1 and not o.pair]
    return rate(o.right for o in single)


def _placed(outcomes: Outcomes) -> str:
    single = [o for o in outcomes if o.kind == "single" and len(o.answers) == 1 and not o.pair and o.right]
    return rate(o.placed for o in single if o.placed is not None)


def _covered(outcomes: Outcomes) -> str:
    return rate(
        any(o.stated & same for same in o.same.values())
        or any(a & same for a in o.answers for same in o.same.values())
        for o in _found(outcomes)
        if o.stated or o.answers
    )


def _misnamed(outcomes: Outcomes) -> str:
    """Return how often an outsider gets a name; a name that the case lists as its alias is none."""
    outside = [o for o in _heard(outcomes) if o.kind == "outsider"]
    return rate(any(not a & same for a in o.answers for same in o.same.values()) for o in outside)


def _chance(outcomes: Outcomes, merge: bool) -> str:
    singles = [o for o in _strong(outcomes, 50) if o.kind == "single" and o.set != "real"]
    return mean(o.chance(merge) or 0.0 for o in singles)


def _closed(outcomes: Outcomes) -> list[Outcome]:
    return [o for o in outcomes if o.number("G") == o.number("G")]


def _closure(outcomes: Outcomes) -> str:
    """Return the mean G, within 0 and 1, over the mean of the oracle's, on singles that were closed."""
    singles = [o for o in _closed(_strong(outcomes, 50)) if o.kind == "single" and o.called]
    known = [o for o in singles if o.number("ideal_G") >= LEAST_G]
    if not known:
        return "no cases"
    mine = [min(max(o.number("G"), 0.0), 1.0) for o in known]
    best = [min(o.number("ideal_G"), 1.0) for o in known]
    each = f"{statistics.mean(mine):.2f} of {statistics.mean(best):.2f}"
    return f"{sum(mine) / sum(best):.2f}: {each} (n {len(known)})"


def _mean_g(outcomes: Outcomes) -> str:
    singles = [o for o in _closed(_strong(outcomes, 50)) if o.kind == "single" and o.set != "real"]
    return mean(min(max(o.number("G"), 0.0), 1.0) for o in singles if o.called)


def _pairs(outcomes: Outcomes) -> str:
    both = [o for o in _strong(outcomes, 200) if o.kind == "pair"]
    return rate(o.right for o in both)


def _half_pairs(outcomes: Outcomes) -> str:
    both = [o for o in _strong(outcomes, 200) if o.kind == "pair"]
    return rate(len(o.answers) == 1 and any(o.answers[0] & same for same in o.same.values()) for o in both)


def _worse(o: Outcome) -> bool:
    """Return whether the closure makes matters worse where the effect acts."""
    if o.number("log_score_gain") < 0:
        return True
    return any(o.number(f"{w}_after") > STEADY * o.number(f"{w}_before") for w in ("rmse", "rmse_named"))


def _unearned(outcomes: Outcomes) -> str:
    return rate(_worse(o) for o in outcomes if o.answers)


def _judged(outcomes: Outcomes) -> str:
    columns = ("log_score_gain", "rmse_after", "rmse_named_after")
    return rate(any(o.raw[c] for c in columns) for o in outcomes if o.answers)


def _seconds(outcomes: Outcomes) -> str:
    known = sorted(o.number("seconds") for o in outcomes if o.raw["seconds"])
    if not known:
        return "no cases"
    return f"{statistics.median(known):.1f} ({known[min(int(0.9 * len(known)), len(known) - 1)]:.1f})"


def _loaded(text: str, empty: Any) -> Any:
    return json.loads(text) if text else empty


if __name__ == "__main__":
    main()

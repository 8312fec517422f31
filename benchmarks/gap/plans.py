"""Which cases are flown: nulls, single effects, pairs, and effects outside the library, by vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import bench  # first: it finds what lies beside it
import c172p_truths
import la8_truths
import numpy as np
from truth import Truth

STRATA = (15, 50, 200)
GUSTS = 1.5  # m/s at 20 ft, in every fifth case; for the c172p only that there are any


def nuisance(number: int) -> dict[str, float]:
    """Return noise and gusts of a case by its number."""
    return {
        "noise": 2.0 if number % 4 == 3 else 1.0,
        "gusts": GUSTS if number % 5 == 4 else 0.0,
    }


def _place(truth: Truth, number: int) -> str:
    return truth.places[number % len(truth.places)]


def nulls(count: int) -> list[bench.Case]:
    """Return cases without an effect."""
    return [{"kind": "null", "parts": [], "lam": 0, "seed": k, **nuisance(k)} for k in range(count)]


def singles(
    truths: Sequence[Truth], seeds: Sequence[int], strata: Sequence[int] = STRATA
) -> list[bench.Case]:
    """Return cases of one effect each: every truth, stratum and seed."""
    found = []
    for seed in seeds:
        for i, truth in enumerate(truths):
            for j, lam in enumerate(strata):
                number = 7 * i + 3 * j + 5 * seed
                part = [truth.id, truth.form, _place(truth, i + seed)]
                kind = "outside" if truth.id.startswith("outside") else "single"
                found.append(
                    {
                        "kind": kind,
                        "parts": [part],
                        "lam": lam,
                        "seed": 1000 + 100 * i + 10 * j + seed,
                        "turn": seed,
                        **nuisance(number),
                    }
                )
    return found


def doubles(truths: Sequence[Truth], count: int) -> list[bench.Case]:
    """Return cases of two effects, each at 50 or 200."""
    rng = np.random.default_rng(3)
    found = []
    while len(found) < count:
        both = rng.choice(len(truths), 2, replace=False)
        number = len(found)
        parts = [[truths[i].id, truths[i].form, _place(truths[i], i)] for i in both]
        found.append(
            {
                "kind": "double",
                "parts": parts,
                "lam": (50, 200)[number % 2],
                "seed": 9000 + number,
                **nuisance(number),
            }
        )
    return found


_OTHERWISE = {t.id: t for t in la8_truths.OTHER}
PRIMARY = tuple(_OTHERWISE.get(t.id, t) for t in la8_truths.OWN)
"""One truth an effect: in another form than the candidate's where there is one."""

SECOND = tuple(t for t in la8_truths.OWN if t.id in _OTHERWISE)
"""The library's own formulas of the others."""


def la8(nulls_: int = 60, seeds: int = 3, outside: int = 30, pairs: int = 30) -> list[bench.Case]:
    """Return all cases of the LA-8, the most wanted first."""
    rest = singles(la8_truths.OUTSIDE, range(5), (50, 200))
    return [
        *nulls(nulls_)[:8],
        *(case for lam in (50, 200) for case in singles(PRIMARY, [0]) if case["lam"] == lam),
        *rest[:12],
        *doubles(PRIMARY, pairs)[:6],
        *nulls(nulls_)[8:26],
        *(case for case in singles(PRIMARY, [0]) if case["lam"] == 15),
        *nulls(nulls_)[26:],
        *rest[12:outside],
        *doubles(PRIMARY, pairs)[6:],
        *(case for seed in range(1, seeds) for case in singles(PRIMARY, [seed])),
        *singles(SECOND, [3]),
    ]


def c172p(nulls_: int = 120, seeds: int = 3, outside: int = 32, pairs: int = 24) -> list[bench.Case]:
    """Return all cases of the c172p, the most wanted first."""
    inside = c172p_truths.INSIDE
    first = singles(inside, [0])
    rest = singles(c172p_truths.OUTSIDE, range(2), (50, 200))
    listed = [
        *nulls(nulls_)[:20],
        *(case for lam in (200, 50) for case in first if case["lam"] == lam),
        *rest[:16],
        *singles(c172p_truths.SECOND, [3]),
        *(case for case in first if case["lam"] == 15),
        *doubles(inside, pairs),
        *nulls(nulls_)[20:40],
        *rest[16:outside],
        *(case for seed in range(1, seeds) for case in singles(inside, [seed])),
        *nulls(nulls_)[40:],
    ]
    return [{"vehicle": "c172p", **case} for case in listed]


def described(case: Mapping[str, Any]) -> str:
    """Return a case in a few words."""
    names = "+".join(f"{i}/{form}{'/' + place if place else ''}" for i, form, place in case["parts"])
    return f"{case['kind']} {names} lambda {case['lam']} seed {case['seed']}"

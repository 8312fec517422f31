"""At which size a truth has a detectability: found by flying it, kept as a curve of what was tried."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
from bench import Bench, Case, Circumstances, detectability
from truth import Part, Truth

from freqid.core.errors import FreqidError
from freqid.core.store import replacing
from freqid.gap.compare import Compared

CLOSE = 1.6  # times the detectability that was asked for, or so much less, that a size may miss it by
TRIES = 4  # new sizes for each detectability
_AROUND = Circumstances(noise=1.0, seed=900)


def parts_of(bench: Bench, case: Case, folder: Path) -> list[Part]:
    """Return a case's truths at their sizes, which are kept in a folder."""
    found = []
    for identifier, form, place in case["parts"]:
        truth = bench.find(identifier, form)
        found.append(Part(truth, place, sized(bench, truth, place, float(case["lam"]), folder)))
    return found


def sized(bench: Bench, truth: Truth, place: str, target: float, folder: Path) -> float:
    """Return the size at which a truth has a detectability on the nominal aircraft in plain noise.

    A case with scatter, gusts or more noise measures its own, and is counted by that. Where the largest size
    has less, that one is returned, and no size within what tolerances allow for: that is no effect. All that
    is found on the way is kept in the folder, so that other detectabilities begin from it.

    Raises
    ------
    ArithmeticError
        Where no size flies.
    """
    name = f"{bench.name}-{truth.id}-{truth.form}-{place or 'all'}".replace(" ", "_")
    path = folder / f"{name}.json"
    known = dict(json.loads(path.read_text())) if path.is_file() else {}
    tried = {float(size): float(found) for size, found in known.items()}
    too_much = truth.most * 1.0001
    for _ in range(TRIES):
        size = step(tried, truth.one, target, truth.most, too_much)
        if size in tried:
            break
        try:
            tried[size] = _detectability_at(bench, Part(truth, place, size))
        except (FreqidError, ArithmeticError, ValueError):
            too_much = size
            continue
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial:
            partial.write_text(json.dumps({repr(k): v for k, v in tried.items()}) + "\n")
    if not tried:
        raise ArithmeticError(f"{name}: no size flies")
    size = min(tried, key=lambda x: _off(tried[x], target))
    if _off(tried[size], target) <= np.log(CLOSE):
        size *= float((target / tried[size]) ** (1 / _power(tried, target)))
    return float(np.clip(size, truth.least(place, bench.tolerances), truth.most))


def _detectability_at(bench: Bench, part: Part) -> float:
    """Return the detectability in the metric of flights without the truth, near enough for a size."""
    compared = _nominal(bench)
    changes = [bench.change(at, [part], c, _AROUND) for at, c in zip(bench.at, compared, strict=True)]
    return detectability(compared, changes)


@lru_cache(maxsize=2)
def _nominal(bench: Bench) -> tuple[Compared, ...]:
    return tuple(bench.measured(bench.fly(at, (), _AROUND), 5) for at in bench.at)


def _off(found: float, target: float) -> float:
    return abs(float(np.log(max(found, 1e-9) / target)))


def step(tried: Mapping[float, float], one: float, target: float, most: float, too_much: float) -> float:
    """Return what size to try next: one that was tried where it is good enough or nothing is beyond.

    Detectability grows with the size by a power, which is read off two sizes that were tried and is two
    before; where the lower of two sizes about the target has next to none, as below a limit or a width,
    the next is between them.
    """
    if not tried:
        return one if one < too_much else 0.4 * too_much
    near = min(tried, key=lambda x: _off(tried[x], target))
    if _off(tried[near], target) < np.log(CLOSE):
        return near
    less = max((x for x in tried if tried[x] < target), default=None)
    more = min((x for x in tried if tried[x] >= target), default=None)
    if less is not None and more is not None and less < more:
        size = float(np.sqrt(less * more))
        if tried[less] > 1e-2 * target:
            rise = np.log(tried[more] / tried[less]) / np.log(more / less)
            size = less * float((target / tried[less]) ** (1 / rise))
        return size if size < too_much else 0.5 * (less + too_much)
    size = near * float(np.clip((target / max(tried[near], 1e-9)) ** (1 / _power(tried, target)), 0.05, 8.0))
    size = min(size, most)
    return size if size < too_much else 0.5 * (near + too_much)


def _power(tried: Mapping[float, float], target: float) -> float:
    near = sorted(tried, key=lambda x: _off(tried[x], target))[:2]
    if len(near) < 2 or min(tried[n] for n in near) <= 1e-6:
        return 2.0
    rise = np.log(tried[near[0]] / tried[near[1]]) / np.log(near[0] / near[1])
    return float(np.clip(rise, 0.7, 8.0)) if np.isfinite(rise) else 2.0

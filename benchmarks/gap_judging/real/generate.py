"""Generate the judging set of real flights: ``python generate.py OUT [--aircraft NAME]``.

Every case is a folder under ``OUT/real``. Aircraft whose data are absent are skipped, and said so.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attas
import f16xl
import hfb320
import nanodrone
import numpy as np
import twin_otter
from cases import Judged, remove_cases, write_cases
from models import Shape, departures, quality
from records import AbsentData, say

Fits = dict[str, dict[str, float]]
AIRCRAFT = {
    "attas_lateral": (attas.lateral, attas.LATERAL),
    "twin_otter_lateral": (twin_otter.lateral, twin_otter.LATERAL),
    "twin_otter_elevator": (twin_otter.elevator, twin_otter.ELEVATOR),
    "hfb320": (hfb320.longitudinal, hfb320.SHAPE),
    "attas_short_period": (attas.short_period, attas.SHORT_PERIOD),
    "nanodrone": (nanodrone.translation, nanodrone.fit_of),
    "f16xl": (f16xl.oscillation, f16xl.fit_of),
}


def quality_of(judged: Judged, measure: Shape | Callable[[Judged], Fits]) -> dict[str, Any]:
    """Return how well a simulation fits the untouched flights.

    ``r2`` by flight and response; and of linear simulations ``farthest``, the derivative that lies
    farthest from the flights' own, in sigma of tolerance and fit together.
    """
    if not isinstance(measure, Shape):
        return {"r2": _rounded(measure(judged))}
    found = {f.name: quality(judged.model, f, measure) for f in judged.flights()}
    off = departures(judged.model, judged.flights(), measure)
    worst = max(off, key=lambda x: abs(off[x]))
    return {"r2": _rounded(found), "farthest": {worst: round(off[worst], 1)}}


def _rounded(fits: Fits) -> Fits:
    return {name: {c: round(x, 3) for c, x in row.items()} for name, row in fits.items()}


def main() -> int:
    """Generate, and print what was made and how well each simulation fits."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--aircraft", choices=sorted(AIRCRAFT), action="append")
    options = parser.parse_args()
    out = options.out / "real"
    skipped = []
    for name in options.aircraft or AIRCRAFT:
        make, measure = AIRCRAFT[name]
        try:
            sets = make()
        except AbsentData as absent:
            say(f"{name}: skipped, {absent}")
            skipped.append(name)
            continue
        written = []
        remove_cases(name, out)
        for judged in sets:
            quality = quality_of(judged, measure)
            written += write_cases(judged, out, quality)
            say(f"{name} {judged.name}: {quality}")
        kinds = Counter(about["kind"] for about in written)
        say(f"{name}: {dict(kinds)}")
    index = sorted(path.parent.name for path in out.glob("*/case.json"))
    out.mkdir(parents=True, exist_ok=True)
    (out / "index.json").write_text(json.dumps(index, indent=1) + "\n")
    say(f"{len(index)} cases in {out}" + (f"; skipped {', '.join(skipped)}" if skipped else ""))
    return 0 if index or not skipped else 3


if __name__ == "__main__":
    np.seterr(all="ignore")
    raise SystemExit(main())

"""The calibration that ships, from open cases.

    python benchmarks/gap/calibrate.py FOLDER...

Folders are those of run.py; freqid/gap/calibration.json is written anew, its version one higher where numbers
change.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

from known import known_cases, read

import freqid.gap
from freqid.core.store import replacing
from freqid.gap.fit_table import RANGES, fit_table

PATH = Path(freqid.gap.__file__).with_name("calibration.json")
DOMAIN = {"kinds": ["jsbsim", "scenario"], "manoeuvres": [2, 10], "duration_s": [40.0, 150.0]}


def main() -> None:
    found = read(sys.argv[1:])
    table = fit_table(known_cases(found))
    numbers = {
        n: round(getattr(table, n), 4) for n in (*RANGES, "pair_gain", "set_level", "uncalled_set_level")
    }
    before = json.loads(PATH.read_text()) if PATH.is_file() else {}
    changed = before.get("numbers") != numbers
    count = Counter(f["case"]["kind"] for f in found)
    whole = {
        "version": before.get("version", 0) + changed,
        "made_by": "python benchmarks/gap/calibrate.py",
        "code": " ".join(sorted({f["code"] for f in found})),
        "cases": dict(sorted(count.items())),
        "numbers": numbers,
        "domain": DOMAIN,
    }
    with replacing(PATH) as partial:
        partial.write_text(json.dumps(whole, indent=2) + "\n")
    print(json.dumps(whole, indent=2))


if __name__ == "__main__":
    main()

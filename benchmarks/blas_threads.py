"""Time a diagnosis from Python with one thread of BLAS, and with as many as there are cores.

The flights are those of examples/foreign_simulation.py. Times hold for this machine and what else runs on it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
DIAGNOSE = """
import freqid as fq
flights = ["flight1.h5", "flight2.h5"]
fq.diagnose_gap("foreign_simulation.py:wrench", flights, held_out="flight3.h5", plan=False)
"""


def main() -> None:
    """Print wall and processor seconds of both."""
    sys.path.insert(0, str(EXAMPLES))
    import foreign_simulation

    with tempfile.TemporaryDirectory() as folder:
        foreign_simulation.write_flights(Path(folder), 0.06)
        (Path(folder) / "foreign_simulation.py").write_bytes(
            (EXAMPLES / "foreign_simulation.py").read_bytes()
        )
        others = {n: x for n, x in os.environ.items() if not n.endswith("_NUM_THREADS")}
        for name, environment in (
            ("one thread, as verbs ask for", others),
            (f"{os.cpu_count()} threads", {**others, "OPENBLAS_NUM_THREADS": str(os.cpu_count())}),
        ):
            before, start = os.times(), time.perf_counter()
            subprocess.run([sys.executable, "-c", DIAGNOSE], cwd=folder, env=environment, check=True)
            taken, after = time.perf_counter() - start, os.times()
            spent = after.children_user + after.children_system
            spent -= before.children_user + before.children_system
            print(f"{name}: {taken:.1f} s, {spent:.1f} s of processor", flush=True)


if __name__ == "__main__":
    main()

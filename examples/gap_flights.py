"""Fly an aircraft whose elevator has lost a part of its effect: flights for ``diagnose-gap``.

Run as ``python examples/gap_flights.py FOLDER``; the simulation that knows nothing of the loss is
``linear_simulation.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

from linear_record import DERIVATIVES, fly

LOSS = 0.5
"""Share of the elevator's deflection that the air does not feel."""


def derivatives(loss: float = LOSS) -> dict[str, dict[str, float]]:
    """Return the derivatives of the aircraft with the loss."""
    return {
        response: {n: c * (1 - loss if n == "de" else 1) for n, c in row.items()}
        for response, row in DERIVATIVES.items()
    }


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for seed in (1, 2, 3):
        log = fly(seed=seed, periods=1, derivatives=derivatives())
        log.to_csv(folder / f"flight{seed}.csv", index=False, float_format="%.10g")

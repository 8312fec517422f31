"""Noise-free estimates and the linearised simulation, by amplitude: `python benchmarks/study_amplitude.py`.

The LA-8 simulation flies the multisines of the scenario at 1, 1/2, 1/4 and 1/8 of their amplitudes; sensors
without error log it. By response, the difference of the estimates from the derivatives of
`freqid.simulate.control.linearize` at the trim, over all parameters:

size    each times the rms of its regressor at full amplitude, root sum square over the derivatives', per
        cent.
errors  over the standard errors at research-quality noise and full amplitude, root mean square.

To each difference ``a + b scale + c scale^2`` is fitted: b from products of two regressors, which this
manoeuvre does not tell from single ones, and c from products of three. `zero` is the size of a, what is left
at no amplitude, and `most_left` the regressor that has most of it. The linearisation has wakes in their
steady state, the flight delays them by what they travel; so everything is done again without wakes. Writes
benchmarks/study_amplitude.csv.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from _la8 import SCENARIO, closed_loop, flown, identified, inputs, logged, table, told, write
from joblib import Parallel, delayed

from freqid.core.channels import WRENCH
from freqid.core.results.design import SampledInputs
from freqid.simulate.control.linearize import STATES, linearize

CONDITIONS = ("u00", "u20", "u45", "u62")
SCALES = (1.0, 0.5, 0.25, 0.125)


def condition(identifier: str, wake: float, signals: SampledInputs) -> list[dict[str, str]]:
    """Return the rows of one condition."""
    at = SCENARIO.reference_of(identifier)
    loop = closed_loop(at.rho, wake)
    linear = linearize(SCENARIO, loop.parameters, loop.trims[identifier])
    truths = [flown(at, signals, scale, wake) for scale in SCALES]
    models = [identified(logged(truth, 0.0), at, "least-squares") for truth in truths]
    names = models[0]["X"].regressors
    columns = [[*STATES[:6], *linear.effectors].index(name) for name in names]
    true, moved = linear.wrench[:, columns], models[0]["X"].regressor_rms
    difference = np.array([table(model)[0] - true for model in models])
    stated = table(identified(logged(truths[0], 1.0), at))[1]
    whole = np.linalg.norm(true * moved, axis=1)

    def size(values: np.ndarray) -> np.ndarray:
        return 100 * np.linalg.norm(values * moved, axis=1) / whole

    law = np.linalg.lstsq(np.vander(SCALES, 3), difference.reshape(len(SCALES), -1))[0]
    zero = law[-1].reshape(true.shape)
    rows = []
    for i, response in enumerate(WRENCH):
        row = {"condition": identifier, "wakes": "on" if wake else "off", "response": response}
        row |= {f"size_{s:g}": f"{size(d)[i]:.3f}" for s, d in zip(SCALES, difference, strict=True)}
        row["size_zero"] = f"{size(zero)[i]:.3f}"
        for name, d in (*zip(SCALES, difference, strict=True), ("zero", zero)):
            row[f"errors_{name}"] = f"{np.sqrt(np.mean((d / stated)[i] ** 2)):.3f}"
        rows.append(row | {"most_left": names[int(np.argmax(np.abs(zero[i]) * moved))]})
    return rows


def main() -> None:
    signals = inputs(0)
    found = Parallel(n_jobs=2, return_as="generator")(
        delayed(condition)(identifier, wake, signals) for wake in (1.0, 0.0) for identifier in CONDITIONS
    )
    rows = told(found)
    write(Path(__file__), rows)


if __name__ == "__main__":
    main()

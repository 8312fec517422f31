"""What the simulation knows of a flight: its linearisation, and noise-free estimates that tell why."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypedDict

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.results.design import SampledInputs, read_inputs
from freqid.core.results.judged.truth import KnownTruth
from freqid.core.scenario import Scenario, read_scenario
from freqid.core.sections.estimators import EstimatorName
from freqid.simulate.control.lq import ClosedLoop, close_loop
from freqid.workflows.models.identify import identify_point
from freqid.workflows.studies.units import closed_loop

SMALL = 0.125
"""Share of a flight's signals that is flown in place of none: what goes with the amplitude is then down to an
eighth or less (benchmarks/study_amplitude.py)."""


class _How(TypedDict):
    at: str
    sensors: str
    seed: int


Derivatives = dict[str, dict[str, float]]
"""By response and regressor."""
Known = tuple[Derivatives, dict[str, KnownTruth]]


def know(
    path: Path,
    *,
    scenario: str,
    reference: str,
    design: str,
    sensors: str,
    seed: int,
    estimator: EstimatorName | None,
) -> None:
    """Write the linearised simulation, and estimates from three flights without noise, as JSON.

    The flight of `seed` is logged again by sensors without error, flown with `SMALL` of its signals, and
    flown so by the same aircraft without wakes. Each is identified as the flight with noise is, on the same
    lines: two estimators make different things of what is not linear, which is not noise.

    Raises
    ------
    DataError
        Where one of these flights diverges.
    """
    from freqid.simulate.maneuver import with_effects

    described, sha256 = read_scenario(scenario)
    at = described.reference_of(reference)
    full = read_inputs(Path(design))
    small = replace(full, values=SMALL * full.values)
    loop = closed_loop(scenario, sha256, at.rho)
    how: _How = {"at": reference, "sensors": sensors, "seed": seed}
    found = {
        "linear": _linearised(described, loop, reference),
        "noise_free": _estimated(described, full, loop, estimator, how),
        "small": _estimated(described, small, loop, estimator, how),
        "no_wake": {},
    }
    if len(described.aircraft().wings) > 1:
        bare = with_effects(described, {"wing_wake": 0.0})
        of_bare = close_loop(bare, at)
        known = _linearised(bare, of_bare, reference)
        found["no_wake"] = {
            response: {n: value - known.get(response, {}).get(n, np.nan) for n, value in row.items()}
            for response, row in _estimated(bare, small, of_bare, estimator, how).items()
        }
    path.write_text(json.dumps(found, indent=1) + "\n")


def read_known_truth(path: Path) -> Known:
    """Return the linearised simulation, and what is known of each response, from the file of `know`.

    Raises
    ------
    DataError
        Where the file is damaged.
    """
    try:
        table: Mapping[str, Derivatives] = json.loads(path.read_text())
    except ValueError as error:
        raise DataError(
            f"is damaged ({error})", where=str(path), remedy="delete it, and the study makes it again"
        ) from None
    truth = {}
    for response, row in table["noise_free"].items():
        names = tuple(row)
        linear, small = (_column(table[of].get(response, {}), names) for of in ("linear", "small"))
        # An aircraft without a second wing has no wake: all that a small flight misses has another cause.
        bare = table["no_wake"].get(response)
        left = small - linear if bare is None else _column(bare, names)
        truth[response] = KnownTruth(names, linear, _column(row, names), small, left, SMALL)
    return table["linear"], truth


def _column(row: Mapping[str, float], names: tuple[str, ...]) -> Array:
    return np.array([row.get(name, np.nan) for name in names], dtype=float)


def _estimated(
    scenario: Scenario,
    inputs: SampledInputs,
    loop: ClosedLoop,
    estimator: EstimatorName | None,
    how: _How,
) -> Derivatives:
    """Return what is identified from a flight that is logged without error."""
    from freqid.workflows.fly import simulate

    flown = simulate(scenario, inputs, loop=loop, **how)
    flown.refuse_divergence(f"{how['at']}, without noise")
    model = identify_point(flown.record, scenario, at=how["at"], estimator=estimator)
    return {
        name: dict(zip(r.regressors, r.estimate.tolist(), strict=True)) for name, r in model.responses.items()
    }


def _linearised(scenario: Scenario, loop: ClosedLoop, reference: str) -> Derivatives:
    from freqid.core.channels import WRENCH
    from freqid.simulate.control.linearize import STATES, linearize

    found = linearize(scenario, loop.parameters, loop.trims[reference])
    names = [*STATES[:6], *found.effectors]
    return {
        r: dict(zip(names, row.tolist(), strict=True)) for r, row in zip(WRENCH, found.wrench, strict=True)
    }

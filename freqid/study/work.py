"""Units of work of a study, each a function that the runner may call in a process of its own.

A unit reads files and writes one; its inputs are text and numbers, so that its result can be found again.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver, read_record, write_record
from freqid.core.results.design import read_inputs, write_design
from freqid.core.results.point import write_point
from freqid.core.scenario import read_scenario
from freqid.design.finish import finish
from freqid.design.multisine.orthogonal_set import design_multisines, sampled
from freqid.identify.point import Estimator, identify_point, predict


def design(path: Path, *, scenario: str, seed: int) -> None:
    """Write the multisines of a scenario."""
    described, sha256 = read_scenario(Path(scenario))
    if described.excitation is None:
        raise UsageError("section [excitation] is missing", where=scenario, remedy="add it")
    searched = design_multisines(described.excitation, described.effector, seed=seed)
    found = finish(searched, described.excitation, described.effector).design
    write_design(path, found, sampled(found), sha256)


def fly(
    path: Path,
    *,
    scenario: str,
    reference: str,
    design: str,
    sensors: str,
    noise: float,
    seed: int,
) -> None:
    """Write what the aircraft logs of a manoeuvre.

    Raises
    ------
    DataError
        Where the flight diverges: an incomplete manoeuvre is no result.
    """
    from freqid.simulate.maneuver import Conditions, fly_maneuver

    described, sha256 = read_scenario(Path(scenario))
    at = described.reference_of(reference)
    flown = fly_maneuver(
        described,
        at,
        read_inputs(Path(design)),
        Conditions(sensors=sensors, noise=noise, seed=seed),
        loop=_closed_loop(scenario, sha256, at.rho),
    )
    if flown.divergence:
        raise DataError(str(flown.divergence), where=reference, remedy="lower the inputs")
    write_record(path, flown.record, sha256)


@lru_cache(maxsize=2)
def _closed_loop(scenario: str, sha256: str, rho: float):
    """Return trims and control law of one corridor; the hash keeps a changed file from being mistaken."""
    from freqid.simulate.control.lq import close_loop

    described, _ = read_scenario(Path(scenario))
    return close_loop(described, next(at for at in described.reference if at.rho == rho))


def identify(
    path: Path, *, scenario: str, reference: str, record: str, validation: str, estimator: Estimator | None
) -> None:
    """Write the point model of a manoeuvre, with its prediction of another."""
    described, sha256 = read_scenario(Path(scenario))
    if described.identification is None:
        raise UsageError("section [identification] is missing", where=scenario, remedy="add it")
    settings = described.identification
    flown, held_out = (Maneuver.of(read_record(Path(file))) for file in (record, validation))
    model = identify_point(
        flown,
        settings,
        excitation=described.excitation,
        reference=described.reference_of(reference),
        estimator=estimator,
    )
    sources = {"record": record, "predicted": validation, "scenario": {"file": scenario, "sha256": sha256}}
    model = replace(
        model, prediction=predict(model, held_out, settings), provenance={**model.provenance, **sources}
    )
    write_point(path, model, sha256)


def linearise(path: Path, *, scenario: str, reference: str) -> None:
    """Write the derivatives of the simulation at a trim, by response and regressor, as JSON."""
    from freqid.core.channels import WRENCH
    from freqid.simulate.control.linearize import STATES, linearize

    described, sha256 = read_scenario(Path(scenario))
    at = described.reference_of(reference)
    loop = _closed_loop(scenario, sha256, at.rho)
    found = linearize(described, loop.parameters, loop.trims[reference])
    names = [*STATES[:6], *found.effectors]
    rows = {
        r: dict(zip(names, row.tolist(), strict=True)) for r, row in zip(WRENCH, found.wrench, strict=True)
    }
    path.write_text(json.dumps(rows, indent=1) + "\n")

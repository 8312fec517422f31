"""Units of work of a study, each a function that the runner may call in a process of its own.

A unit reads files and writes one; its inputs are text, numbers and paths of files, which count by their
contents, so that its result can be found again wherever the folder lies.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from freqid.core.errors import DataError
from freqid.core.record import write_record
from freqid.core.scenario import read_scenario
from freqid.core.sections.estimators import EstimatorName


def design(path: Path, *, scenario: str, seed: int, at: str = "") -> None:
    """Write the multisines of a scenario, or of one of its conditions that states its own."""
    from freqid.workflows.design import design_inputs

    design_inputs(scenario, at=at, seed=seed).save(path)


def fly(
    path: Path,
    *,
    scenario: str,
    reference: str,
    design: Path,
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
    from freqid.workflows.fly import simulate

    described, sha256 = read_scenario(scenario)
    loop = closed_loop(scenario, sha256, described.reference_of(reference).rho)
    flown = simulate(described, design, at=reference, sensors=sensors, noise=noise, seed=seed, loop=loop)
    if flown.divergence:
        raise DataError(flown.divergence, where=reference, remedy="lower the inputs")
    write_record(path, flown.record, sha256)


@lru_cache(maxsize=2)
def closed_loop(scenario: str, sha256: str, rho: float):
    """Return trims and control law of one corridor; the hash keeps a changed file from being mistaken."""
    from freqid.simulate.control.lq import close_loop

    described, _ = read_scenario(scenario)
    return close_loop(described, next(at for at in described.reference if at.rho == rho))


def identify(
    path: Path,
    *,
    scenario: str,
    reference: str,
    record: Path,
    validation: Path,
    estimator: EstimatorName | None,
) -> None:
    """Write the point model of a manoeuvre, with its prediction of another."""
    from freqid.workflows.files import save
    from freqid.workflows.models.identify import identify_point

    save(identify_point(record, scenario, at=reference, held_out=validation, estimator=estimator), path)

"""A model under the user's control law: what its uncertainty means for stability margins, modes and trim."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from freqid import __version__
from freqid.blend.global_model import GlobalModel
from freqid.blend.state_space import vehicle_of
from freqid.compare import read_law
from freqid.compare.loop_margins import MotionAt, loop_margins, places_of
from freqid.core.blas import on_one_thread
from freqid.core.errors import UsageError
from freqid.core.results.loop_margins import LoopMargins
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference, Scenario, is_scenario
from freqid.core.vehicle import Vehicle
from freqid.dynamics.control_law import LawAt
from freqid.workflows.inputs import File, Tell, model_of, name_of, scenario_of, silent

MEMORY_REMARK = (
    "The model has no memory: what arrives late, as one wing's wake at the other, is in its rate "
    "derivatives as far as the excited band shows it, so that its margins may differ from those of the "
    "steady derivatives of a simulation"
)


@on_one_thread
def margins(
    model: GlobalModel | PointModel | File,
    loop: Any,
    at: str | float | Reference | Iterable[str | float | Reference] = (),
    *,
    scenario: Scenario | File | None = None,
    draws: int = 200,
    seed: int = 0,
    level: float = 0.95,
    beside: Sequence[GlobalModel | Scenario | File] = (),
    tell: Tell = silent,
) -> LoopMargins:
    """Return stability margins, modes and trim authority of a model under a control law, with intervals.

    Parameters
    ----------
    model : GlobalModel, PointModel or path
        Of forces and moments, all six.
    loop : path, python-control object, Scenario or callable
        A loop file (TOML or MAT), ``FILE.py:NAME``, a python-control system from signals to effectors (SI,
        from the trim), a function of speed and density that returns one, or a scenario, whose own law and
        actuators are then taken.
    at : str, float or Reference, or several
        Ids of the model's points or, where the law is a scenario's, of its conditions; speeds, m/s, or
        conditions; all points where empty.
    scenario : Scenario, path or name, optional
        Vehicle in place of the one that the model was identified with.
    draws : int
        Models drawn from the covariance for the intervals; none where zero.
    seed : int
        Of the draws.
    level : float
        Of the intervals.
    beside : sequence of GlobalModel, Scenario, path or name
        Others to show beside, under the same law: another model, or a scenario's simulation, linearised.
    tell : callable
        Told what begins.

    Returns
    -------
    LoopMargins
        By condition: gain, phase, delay and disk margin at every axis and command of the law, frequency and
        damping of the modes, and the travel that effectors have left at the trim.

    Raises
    ------
    UsageError
        Where law and model do not fit: names, units, a condition that the law or the model does not cover, a
        model without covariance.
    DataError
        Where a file cannot be read, or a condition is outside the corridor.

    Notes
    -----
    Intervals are quantiles over models drawn from the covariance (docs/margins.md).

    Examples
    --------
    >>> found = margins("aircraft.h5", "loop.toml", at=(20.0, 30.0))  # doctest: +SKIP
    >>> found["30 m/s"]["margins/de/phase_deg"]  # doctest: +SKIP
    (61.2, 55.0, 66.9)
    """
    if not 0 < level < 1:
        raise UsageError(f"the level is {level:g}, expected a share such as 0.95")
    if draws < 0 or 0 < draws < _FEWEST:
        raise UsageError(f"{draws} draws give no interval", remedy=f"ask for {_FEWEST} or more, or for none")
    found, name = model_of(model)
    name = Path(name).name
    if isinstance(loop, str | Path) and is_scenario(loop):
        loop = scenario_of(loop)
    described = scenario_of(scenario).aircraft() if scenario is not None else None
    known = found.aircraft if isinstance(found, PointModel) else found.corridor.aircraft
    vehicle = vehicle_of(described, known)
    law, law_name = law_of(loop, vehicle)
    wanted = [at] if isinstance(at, str | int | float | Reference) else list(at)
    others: dict[str, GlobalModel | MotionAt] = {}
    for one in beside:
        what, other = _beside_of(one)
        others[what if what not in others else f"{what} {len(others) + 1}"] = other
    result = loop_margins(
        found,
        law,
        places_of(found, wanted, loop.reference if isinstance(loop, Scenario) else ()),
        vehicle=vehicle,
        draws=draws,
        seed=seed,
        level=level,
        names=(name, law_name),
        beside=others,
        tell=tell,
    )
    return replace(
        result,
        remarks=(MEMORY_REMARK,),
        provenance={
            "model": name,
            "law": law_name,
            "vehicle": vehicle.name,
            "draws": draws,
            "seed": seed,
            "freqid_version": __version__,
        },
    )


_FEWEST = 20  # draws, of which a quantile can be taken at all


def law_of(given: Any, vehicle: Vehicle) -> tuple[LawAt, str]:
    """Return a control law as a function of the condition, and its name.

    Parameters
    ----------
    given : path, python-control object, Scenario or callable
        As `margins` takes it.
    vehicle : Vehicle
        For the kinds, and so the SI units, of effectors.

    Raises
    ------
    UsageError, DataError
        Where it does not fit the vehicle, cannot be read, or is a law by total energy.
    """
    if isinstance(given, str | Path) and is_scenario(given):
        given = scenario_of(given)
    if not isinstance(given, Scenario):
        return read_law.law_of(given, vehicle)
    if "tecs" in given.control:
        raise UsageError(
            "the law of [control.tecs] is not linear about one trim",
            where=name_of(given),
            remedy="describe it about one trim in a loop file (docs/margins.md)",
        )
    from freqid.compare.scenario_law import scenario_law  # jax

    return scenario_law(given), f"law of {Path(name_of(given)).name}"


def _beside_of(given: Any) -> tuple[str, GlobalModel | MotionAt]:
    if isinstance(given, str | Path) and is_scenario(given):
        given = scenario_of(given)
    if isinstance(given, Scenario):
        from freqid.compare.scenario_law import simulated_motion  # jax

        return f"simulation {Path(name_of(given)).name}", simulated_motion(given)
    found, name = model_of(given)
    if isinstance(found, PointModel):
        raise UsageError("a point model cannot stand beside", remedy="give a global model or a scenario")
    return Path(name).name, found

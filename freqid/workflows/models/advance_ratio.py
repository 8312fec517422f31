"""Point models of a blown aircraft become laws against the propellers' advance ratio."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal

import msgspec

from freqid.blend.semi_local.held import semi_local_model
from freqid.blend.semi_local.held_out import HeldOutScores, score_held_out
from freqid.blend.semi_local.one_shot import one_shot_model
from freqid.blend.semi_local.parametric import global_model
from freqid.blend.semi_local.problem import LocalProblem, estimated_maneuvers
from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.results.advance_ratio import AdvanceRatioModel, LocalDerivatives
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.identify.advance_ratio.local import local_derivatives
from freqid.identify.advance_ratio.sensor_errors import with_sensor_errors
from freqid.workflows.inputs import (
    File,
    Flight,
    identification_of,
    maneuver_of,
    point_of,
    scenario_of,
    several,
)

Kind = Literal["global", "semi-local", "one-shot"]
KINDS: tuple[Kind, ...] = ("global", "semi-local", "one-shot")


@on_one_thread
def blend_by_advance_ratio(
    points: Iterable[PointModel | File],
    *,
    kind: Kind = "global",
    clusters: int | None = None,
    hold: Sequence[str] | None = None,
    sensor_errors: Mapping[str, float] | None = None,
    flights: Sequence[Flight] | None = None,
    scenario: Scenario | File | None = None,
) -> AdvanceRatioModel:
    """Fit laws of the advance ratio to the derivatives of many manoeuvres.

    Parameters
    ----------
    points : PointModel or path, several
        One for each manoeuvre, in coefficient form, of one aircraft whose propellers state their diameter.
    kind : {"global", "semi-local", "one-shot"}
        Laws through the estimates; laws after some derivatives were held at them and the others estimated
        again; or the laws' coefficients from all manoeuvres at once.
    clusters : int, optional
        Number of clusters of trim angle of attack; found from the trims where absent.
    hold : sequence of str, optional
        Derivatives that a semi-local model holds, as ``Cm.0``; those that the laws know better than single
        manoeuvres do where absent.
    sensor_errors : mapping of str to float, optional
        One sigma of constant errors that all manoeuvres share, which repetition does not average out:
        ``V`` m/s, ``alpha`` and ``beta`` rad.
    flights : sequence of FlightRecord, Maneuver or path, optional
        The points' own manoeuvres, in their order: semi-local and one-shot models then fit their motion by
        output error. Where absent, estimates and their covariances stand for the manoeuvres, which is exact
        for equation error.
    scenario : Scenario, path or name, optional
        Says with ``[identification]``, in coefficient form and body axes, which derivatives the flights tell.

    Returns
    -------
    AdvanceRatioModel
        ``model.clusters[0]["CZ.alpha"].value(0.6)``; J = inf is the unblown limit. Its remarks say where
        trims are too few to tell a law.

    Raises
    ------
    UsageError
        Where options do not fit the points.
    DataError
        Where a file is no intact point model, or a point states no advance ratio.

    Examples
    --------
    >>> model = blend_by_advance_ratio(sorted(Path("points").glob("*.h5")))  # doctest: +SKIP
    >>> model.derivatives(advance_ratio=0.6, alpha=0.1)["Cm.de"]  # doctest: +SKIP
    -1.13
    """
    if kind not in KINDS:
        raise UsageError(f"kind is '{kind}'", remedy=nearest(kind, KINDS))
    if hold is not None and kind != "semi-local":
        raise UsageError(
            f"derivatives shall be held in a {kind} model, but only a semi-local one holds any",
            remedy="ask for kind 'semi-local'",
        )
    local, vehicle, sources = told(points)
    whole = global_model(local, clusters=clusters, vehicle=vehicle, provenance={"points": sources})
    model = whole
    if kind != "global":
        problems = problems_of(local) if flights is None else _motions(local, flights, scenario)
        model = (
            semi_local_model(whole, problems, hold)
            if kind == "semi-local"
            else one_shot_model(whole, problems)
        )
    return with_sensor_errors(model, sensor_errors or {})


def compare_held_out(
    points: Iterable[PointModel | File],
    held_out: Iterable[PointModel | File],
    *,
    clusters: int | None = None,
    hold: Sequence[str] | None = None,
) -> HeldOutScores:
    """Compare local, global, semi-local and one-shot models on manoeuvres that none is made from.

    Parameters
    ----------
    points : PointModel or path, several
        That the models are made from.
    held_out : PointModel or path, several
        That they are judged by.
    clusters, hold
        As in `blend_by_advance_ratio`.

    Returns
    -------
    HeldOutScores
    """
    local, vehicle, _ = told(points)
    others, _, _ = told(held_out)
    whole = global_model(local, clusters=clusters, vehicle=vehicle)
    problems = problems_of(local)
    models = [whole, semi_local_model(whole, problems, hold), one_shot_model(whole, problems)]
    return score_held_out(models, others, problems_of(others))


def _motions(
    local: LocalDerivatives, flights: Sequence[Flight], scenario: Scenario | File | None
) -> dict[str, LocalProblem]:
    """Return the likelihoods of the motion of the points' manoeuvres."""
    from freqid.blend.semi_local.output_error import JoinedManeuver, OutputErrorManeuver
    from freqid.identify.output_error.forms.form import parted

    if scenario is None:
        raise UsageError(
            "flights are given without a scenario that says which derivatives they tell",
            remedy="give the scenario",
        )
    if len(flights) != len(local.ids):
        raise UsageError(
            f"{len(flights)} flights come with {len(local.ids)} points, expected one for each point",
            remedy="give the points' own manoeuvres in their order",
        )
    described = scenario_of(scenario)
    settings = identification_of(described)
    problems: dict[str, LocalProblem] = {}
    for identifier, flight in zip(local.ids, flights, strict=True):
        maneuver = maneuver_of(flight, described)
        try:
            parts = [
                OutputErrorManeuver(maneuver, msgspec.structs.replace(settings, responses=responses))
                for responses in parted(settings.responses, settings.form)
            ]
        except DataError as error:
            raise error.at(identifier) from None
        problems[identifier] = JoinedManeuver(parts)
    return problems


def told(points: Iterable[PointModel | File]) -> tuple[LocalDerivatives, str, list[str]]:
    """Return what point models tell, their vehicle, and where they are from."""
    given = several(points)
    read = [point_of(one) for one in given]
    names = [str(one) if isinstance(one, str | Path) else f"point {i}" for i, one in enumerate(given, 1)]
    return local_derivatives(read, names), read[0].vehicle if read else "", names


def problems_of(local: LocalDerivatives) -> dict[str, LocalProblem]:
    """Return the manoeuvres' likelihoods by id, as their estimates have them."""
    return dict(zip(local.ids, estimated_maneuvers(local), strict=True))

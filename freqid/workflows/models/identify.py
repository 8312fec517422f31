"""Flights at one condition become a point model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from freqid import __version__
from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, GateFailed, UsageError, nearest
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.judged.gates import gate_sentences
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.core.sections.estimators import EstimatorName
from freqid.core.sections.identification import MAXIMUM_LIKELIHOOD, Method
from freqid.core.toml import overridden
from freqid.identify import point
from freqid.identify.point import lines_of
from freqid.identify.sensors.alignment import align as align_maneuver
from freqid.workflows.inputs import (
    File,
    Flight,
    Tell,
    flight_of,
    identification_of,
    maneuver_of,
    names_of,
    record_of,
    scenario_of,
    several,
    silent,
    source_of,
)
from freqid.workflows.models.sensors import (
    Checked,
    Progress,
    checked,
    identified,
    unwatched,
    with_correction_doubt,
)

TimeSpan = tuple[float, float]
Names = Sequence[str] | Mapping[str, Sequence[str]]


@on_one_thread
def identify_point(
    flights: Flight | Iterable[Flight],
    scenario: Scenario | File,
    *,
    at: str = "",
    cut: TimeSpan | Sequence[TimeSpan] = (),
    align: Literal["off", "report", "fit"] = "off",
    kinematics: Literal["off", "report", "correct"] = "off",
    held_out: Flight | None = None,
    estimator: EstimatorName | None = None,
    responses: Sequence[str] | None = None,
    regressors: Names | None = None,
    method: Method | None = None,
    form: Literal["force", "specific", "coefficient"] | None = None,
    axes: Literal["body", "stability"] | None = None,
    structure: Literal["given", "stepwise"] | None = None,
    nonlinear: Literal["none", "products"] | None = None,
    tell: Tell = silent,
    progress: Callable[[str, str], Progress] = lambda what, unit: unwatched,
) -> PointModel:
    """Identify the applied forces and moments as linear functions of states and effectors.

    Parameters
    ----------
    flights : FlightRecord, Maneuver or path, or several
        Several, flown at one condition, make one model; each keeps its own bias.
    scenario : Scenario, path or name
        Its ``[identification]`` says what is identified and how.
    at : str
        Id of the reference condition; the records' own where empty.
    cut : (start, stop), or one for each flight
        Stretches that are used, s on the record's clock; several of one flight make several manoeuvres.
    align : {"off", "report", "fit"}
        Find how late each group of sensors is, and a steady wind; ``"fit"`` takes them out and adds their
        uncertainty to the parameters'.
    kinematics : {"off", "report", "correct"}
        Check first whether the sensors agree with each other; ``"correct"`` takes their errors out, each as
        far as the data say that it is there, and adds what is uncertain in that to the parameters' covariance
        (not to those of maximum likelihood).
    held_out : FlightRecord, Maneuver or path, optional
        Another flight, to predict and score; the model's ``prediction`` holds it.
    estimator : {"least-squares", "instruments"}, optional
        In place of the scenario's, as all that follow. Instruments are not biased by noise in the regressors;
        they need the injected signals.
    responses : sequence of str, optional
        Among X Y Z L M N.
    regressors : sequence of str, optional
        Of all responses; by response as a mapping.
    method : {"frequency", "time", "output-error", "filter-error"}, optional
        Equation error on lines or samples, or maximum likelihood of a ready model's outputs in time; the
        model's provenance then says under ``output_error`` what `identify_output_error` found.
    form : {"force", "specific", "coefficient"}, optional
    axes : {"body", "stability"}, optional
    structure : {"given", "stepwise"}, optional
        ``"stepwise"`` keeps, for each response, only regressors that explain something.
    nonlinear : {"none", "products"}, optional
        ``"products"`` adds products of regressors where noise lines say that a response is not linear.
    tell : callable
        Told what the sensor checks find, a line at a time.
    progress : callable
        Given what is done and of what unit, returns what is told how many are done of how many.

    Returns
    -------
    PointModel
        N and N m per SI unit of the regressor; ``model["M"]["de1"]`` is an estimate with its standard error.
        Its provenance names records, cuts, scenario and what was found of the sensors.

    Raises
    ------
    UsageError
        Where the scenario identifies nothing, flights are of different conditions, or options do not fit.
    DataError
        Where a record cannot be read, lacks a channel, or does not tell a parameter.

    Notes
    -----
    Equation error (Klein & Morelli, 2nd ed., ch. 5 and 7; docs/theory/identification.md), or output error
    (docs/theory/output-error.md).

    Examples
    --------
    >>> model = identify_point(flight, scenario)
    >>> estimate, std_error = model["M"]["de"]
    >>> round(model["M"].r2, 2)
    0.97
    """
    described = scenario_of(scenario)
    settings = overridden(
        identification_of(described),
        responses=None if responses is None else tuple(responses),
        regressors=regressors if regressors is None or isinstance(regressors, Mapping) else tuple(regressors),
        method=method,
        form=form,
        axes=axes,
        structure=structure,
        nonlinear=nonlinear,
    )
    _refuse_unknown("align", align, ("off", "report", "fit"))
    _refuse_unknown("kinematics", kinematics, ("off", "report", "correct"))
    given = several(flights)
    flown = flown_maneuvers(given, described, at, cut)
    maneuvers, names = list(flown.maneuvers), flown.names
    reference = described.reference_of(flown.reference) if flown.reference else None
    described = described.at(flown.reference)
    compatibility: Checked | None = None
    if kinematics != "off":
        compatibility = checked(
            maneuvers,
            names,
            settings=settings,
            excitation=described.excitation,
            correct=kinematics == "correct",
            tell=tell,
            progress=progress("checking sensors", "flight"),
        )
        maneuvers = compatibility.used
    try:
        if settings.method in MAXIMUM_LIKELIHOOD:
            from freqid.workflows.models.output_error import ready_point  # loads jax

            _refuse_alignment(align, settings.method)
            model, alignment = ready_point(maneuvers, settings, reference, described.excitation), {}
        else:
            named = {"excitation": described.excitation, "reference": reference, "estimator": estimator}
            model, alignment = identified(align, maneuvers, names, settings, **named, tell=tell)
            if compatibility is not None and compatibility.corrected:
                model = with_correction_doubt(
                    model,
                    compatibility,
                    lambda moved, fixed: identified(align, moved, names, fixed, **named, tell=silent)[0],
                    settings,
                    aligned=align == "fit",
                    progress=progress("weighing corrections", "error"),
                )
    except DataError as error:
        raise error.at(" and ".join(names_of(given))) from None
    sources = {**flown.sources(), "scenario": source_of(described), "freqid_version": __version__}
    sources |= {"kinematics": compatibility.account} if compatibility else {}
    sources |= {"alignment": alignment} if alignment else {}
    sources |= {k: model.provenance[k] for k in ("structure", "output_error") if k in model.provenance}
    predicted = {}
    if held_out is not None:
        name = names_of([held_out], len(given) + 1)[0]
        try:
            other = maneuver_of(held_out, described)
            if align == "fit":
                other, _ = align_maneuver(other, settings, lines_of(settings, described.excitation))
            predicted = point.predict_responses(model, other, settings)
            if other.record.fingerprint in {record.fingerprint for record in flown.records}:
                remark = f"{name} is predicted by a model that was made from it, which validates nothing."
                model = replace(model, remarks=(*model.remarks, remark))
        except DataError as error:
            raise error.at(name) from None
        sources["predicted"] = name
    return replace(model, provenance=sources, prediction=predicted)


@dataclass(frozen=True)
class FlownManeuvers:
    """Manoeuvres of one condition, and where each is from.

    Attributes
    ----------
    maneuvers : tuple of Maneuver
    names : list of str
        Of the flights that they are from.
    cuts : list of (float, float) or None
        Stretch of each, s on the record's clock.
    records : list of FlightRecord
        Uncut.
    reference : str
        Id of the condition; empty where none is named.
    """

    maneuvers: tuple[Maneuver, ...]
    names: list[str]
    cuts: list[TimeSpan | None]
    records: list[FlightRecord]
    reference: str

    def sources(self) -> dict:
        """Return records, cuts and logs, as the provenance of a model has them."""
        used = [
            {
                "record": name,
                "record_sha256": record.fingerprint,
                "cut": _words(span),
                "log": record.provenance,
            }
            for record, name, span in zip(self.records, self.names, self.cuts, strict=True)
        ]
        return used[0] if len(used) == 1 else {"manoeuvres": used}


def flown_maneuvers(
    flights: Flight | Iterable[Flight], scenario: Scenario | None, at: str, cut: TimeSpan | Sequence[TimeSpan]
) -> FlownManeuvers:
    """Return the manoeuvres that a job is given: whole flights, or stretches of them.

    Raises
    ------
    UsageError
        Where the flights are of different conditions, or stretches do not fit.
    DataError
        Where a record cannot be read, or nobody describes its vehicle.
    """
    given = several(flights)
    stretches = _stretches(list(zip(given, names_of(given), strict=True)), _spans(cut))
    read = [flight_of(flight) for flight, _, _ in stretches]
    spans = [span for _, _, span in stretches]
    return FlownManeuvers(
        tuple(_cut(flight, scenario, span) for flight, span in zip(read, spans, strict=True)),
        [name for _, name, _ in stretches],
        spans,
        list(map(record_of, read)),
        at or _flown_at(list(map(record_of, read))),
    )


def _refuse_alignment(align: str, method: str) -> None:
    if align != "off":
        raise UsageError(
            f"--align {align} came with method '{method}'",
            remedy="align with align_sensors first, or identify with method 'frequency'",
        )


def refuse_missed_gates(model: PointModel, scenario: Scenario, where: str) -> None:
    """Raise where a model misses what its scenario asks for.

    Raises
    ------
    GateFailed
        With every figure of merit that is missed; `where` is the model's file.
    """
    missed = gate_sentences(model, scenario.gates)
    if missed:
        raise GateFailed("; ".join(missed), where=where, remedy="the model is written all the same")


def _refuse_unknown(option: str, value: str, known: Sequence[str]) -> None:
    if value not in known:
        raise UsageError(f"{option} is '{value}'", remedy=nearest(value, known))


def _spans(cut: TimeSpan | Sequence[TimeSpan]) -> list[TimeSpan]:
    """Return the stretches asked for: one pair of numbers is one stretch."""
    spans = list(cut)
    if len(spans) == 2 and all(isinstance(bound, int | float) for bound in spans):
        return [(float(spans[0]), float(spans[1]))]  # type: ignore[arg-type]
    return spans  # type: ignore[return-value]


def _words(span: TimeSpan | None) -> str | None:
    """Return a span as `freqid.core.record.parse_span` reads it."""
    return None if span is None else f"{span[0]:.12g}:{span[1]:.12g}"


def _stretches(
    flights: Sequence[tuple[Flight, str]], spans: Sequence[TimeSpan]
) -> list[tuple[Flight, str, TimeSpan | None]]:
    """Return the manoeuvres asked for: whole flights, one cut of each, or several cuts of one."""
    if not spans:
        return [(flight, name, None) for flight, name in flights]
    if len(flights) > 1 and len(spans) != len(flights):
        raise UsageError(
            f"{len(spans)} --cut came with {len(flights)} records, expected one for each record or none"
        )
    of = flights if len(flights) > 1 else list(flights) * len(spans)
    return [(flight, name, span) for (flight, name), span in zip(of, spans, strict=True)]


def _cut(flight: FlightRecord | Maneuver, scenario: Scenario | None, span: TimeSpan | None) -> Maneuver:
    if isinstance(flight, Maneuver):
        return Maneuver(flight.record.cut(*span), flight.vehicle) if span else flight
    return Maneuver.of(flight, scenario.aircraft() if scenario else None, span)


def _flown_at(flights: Sequence[FlightRecord]) -> str:
    """Return the reference that all records name."""
    named = sorted({flight.reference for flight in flights if flight.reference})
    if len(named) > 1:
        raise UsageError(
            f"the records were flown at different references, {' and '.join(named)}",
            remedy="identify each condition by itself, or name one with --at",
        )
    return named[0] if named else ""

"""A log held against its design, minutes after landing: usable, or repeat, because ..."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.design import ClassicDesign, MultisineDesign, SampledInputs, read_design, read_inputs
from freqid.core.results.point import PointModel
from freqid.core.results.quicklook import InputLook, ParameterLook, Quicklook, RateLook
from freqid.core.scenario import Scenario
from freqid.core.sections.identification import MAXIMUM_LIKELIHOOD, Identification
from freqid.core.vehicle import Effector, Vehicle
from freqid.design.multisine.orthogonal_set import sampled
from freqid.flightlog.plausibility.check import check_plausibility
from freqid.flightlog.plausibility.finding import PlausibilityReport
from freqid.identify import point
from freqid.identify.response import injection
from freqid.identify.response.injection import FALSE_ALARM, Gain
from freqid.workflows.design import DesignedInputs
from freqid.workflows.import_log import read_log
from freqid.workflows.inputs import File, Flight, maneuver_of, names_of, record_of, scenario_of

Design = DesignedInputs | MultisineDesign | ClassicDesign | SampledInputs | File
ACCURACY = 0.2
"""Standard error over the estimate that a parameter is asked for: five standard errors from zero."""
HALF_POWER = 0.5  # of the commanded power that a position must achieve, and explain
LIMITED = 0.02  # share of the time that an effector may be at a limit
WHOLE = 0.98  # of the design that the log must cover
SCALED = 0.1  # that an injection may differ from the design in size before it is worth a remark


@dataclass(frozen=True)
class Planned:
    """A design, its samples, and the band it is meant for."""

    design: object
    inputs: SampledInputs
    band_hz: tuple[float, float]
    name: str


@on_one_thread
def quicklook(
    log: Flight,
    design: Design,
    scenario: Scenario | File | None = None,
    *,
    columns: File | None = None,
    resample_hz: float | None = None,
    at: str = "",
    accuracy: float = ACCURACY,
) -> Quicklook:
    """Hold a log against the design that was to be flown, and say whether it is usable.

    Parameters
    ----------
    log : FlightRecord, Maneuver or path
        A record, or a log that `read_log` reads.
    design : DesignedInputs, MultisineDesign, ClassicDesign, SampledInputs or path
        What was to be flown.
    scenario : Scenario, path or name, optional
        Limits of the effectors, and the regressors whose accuracy is judged; limits are those of the record's
        own vehicle where absent, and no parameters are estimated.
    columns : path, optional
        Column map of a log that needs one.
    resample_hz : float, optional
        Rate that such a log is put on; without it the log must be uniform and have one clock.
    at : str
        Id of the reference condition; the record's own where empty.
    accuracy : float
        Standard error over the estimate that a parameter is asked for. One that matters little is accurate
        enough where the error of its contribution is that share of what the model explains of the response.

    Returns
    -------
    Quicklook
        ``found.usable``; ``found.reasons`` says why not.

    Raises
    ------
    DataError
        Where the log or design cannot be read, or the log cannot be what it claims (`read_log`).
    UsageError
        Where a map is needed and none is given, or the accuracy is not positive.

    Notes
    -----
    Presence is tested on each input's own lines: on M lines, unrelated signals have a coherence above c
    with probability ``(1 - c)^(M - 1)``.

    Examples
    --------
    >>> found = quicklook("flight.h5", "design.h5", "aircraft.toml")  # doctest: +SKIP
    >>> found.sentence  # doctest: +SKIP
    "repeat, because the injection on 'de1' is not in the log."
    """
    if not 0 < accuracy < np.inf:
        raise UsageError(f"accuracy is {accuracy:g}, expected a positive share such as 0.1")
    described = scenario_of(scenario) if scenario is not None else None
    name = names_of([log])[0]
    record, report = _record_of(log, described, columns, resample_hz, at)
    described = described.at(at or record.reference) if described else None
    planned = planned_of(design)
    vehicle = described.aircraft() if described else record.vehicle
    start = injection.find_start(record, planned.inputs)
    looks = look_at_inputs(record, planned, vehicle, start.time_s) if start else ()
    found_at_all = start is not None and any(look.present for look in looks)
    rates = _rates(record, planned, report)
    parameters, trouble = _parameters(record, described, planned, start.time_s if start else 0.0, accuracy)
    reasons = [*_why_input(planned, looks, found_at_all), *_why_rate(rates, planned)]
    if not reasons:
        reasons += [*_why_parameter(parameters, accuracy), *trouble]
    return Quicklook(
        log=name,
        design=planned.name,
        verdict="repeat" if reasons else "usable",
        reasons=tuple(reasons),
        remarks=tuple(_remarks(record, looks, report, described, at or record.reference, parameters)),
        start_s=start.time_s if start and found_at_all else float("nan"),
        likeness=start.likeness if start else 0.0,
        band_hz=planned.band_hz,
        inputs=looks,
        rates=rates,
        parameters=parameters,
        accuracy=accuracy,
        plausibility=report.to_dict(),
        record=record,
        inputs_flown=planned.inputs,
    )


def _record_of(
    log: Flight, scenario: Scenario | None, columns: File | None, resample_hz: float | None, at: str
) -> tuple[FlightRecord, PlausibilityReport]:
    """Return the record, refused where it contradicts itself, and what is said of it."""
    if isinstance(log, str | Path) and Path(log).suffix.lower() != ".h5":
        record = read_log(log, columns, scenario=scenario, at=at, resample_hz=resample_hz, plausibility="off")
    else:
        record = record_of(log)
        if scenario is not None:
            record = replace(record, vehicle=scenario.aircraft())
    at = at or record.reference
    known = {r.id for r in scenario.reference} if scenario else set()
    report = check_plausibility(record, scenario.reference_of(at) if scenario and at in known else None)
    report.refuse(names_of([log])[0])
    return record, report


def planned_of(design: Design) -> Planned:
    """Return a design with its samples and band.

    Raises
    ------
    DataError
        Where the file is no intact design.
    """
    name = str(design) if isinstance(design, str | Path) else "design"
    if isinstance(design, str | Path):
        inputs = read_inputs(Path(design))
        try:
            design = read_design(Path(design))
        except DataError:
            design = inputs
    if isinstance(design, DesignedInputs):
        design = design.design
    if isinstance(design, MultisineDesign):
        return Planned(design, sampled(design), design.band_hz, name)
    if isinstance(design, ClassicDesign):
        return Planned(design, design.inputs, design.band_hz, name)
    return Planned(design, design, _band_of(design), name)


def _band_of(inputs: SampledInputs) -> tuple[float, float]:
    """Return the band that holds 95 % of the power of samples, Hz."""
    power = np.sum(np.abs(np.fft.rfft(inputs.values)) ** 2, axis=0)[1:]
    share = np.cumsum(power) / power.sum()
    f = np.arange(1, power.size + 1) / (inputs.time.size * float(inputs.time[1] - inputs.time[0]))
    low, high = f[np.searchsorted(share, [0.025, 0.975])]
    return float(low), float(high)


def look_at_inputs(
    record: FlightRecord, planned: Planned, vehicle: Vehicle | None, start_s: float
) -> tuple[InputLook, ...]:
    """Look at each input: present, where else, achieved, limited."""
    inputs = planned.inputs
    span = injection.flown_span(record, planned.design, inputs, start_s)
    time = record.time[span]
    covered = time.size * record.dt if time.size > 1 else 0.0
    period = getattr(planned.design, "period_s", float(inputs.time[-1]))
    whole = float(inputs.time[-1])
    inside = min(start_s + whole, float(record.time[-1])) - max(start_s, float(record.time[0]))
    if covered < 1 / planned.band_hz[1]:
        return ()
    lines = injection.own_lines(planned.design, inputs, covered, planned.band_hz)
    flown = injection.on_clock(inputs, time, start_s)
    spectra = {
        n: (injection.line_transforms(row, time, lines[n])[0], lines[n])
        for n, row in zip(inputs.names, flown, strict=True)
    }
    found: dict[str, Gain] = {}
    for n, (signal, f) in spectra.items():
        source = injection.source_of(record, n)
        if source:
            # an excitation is the design itself; a command or a position comes after it
            latest = 0.0 if source.startswith("excitation/") else injection.LATEST_S
            there = injection.line_transforms(record[source][span], time, f)[0]
            found[n] = injection.gain_of(there, signal, f, latest_s=latest)
    missing = {n: spectra[n] for n in inputs.names if n not in found or found[n].p_value > FALSE_ALARM}
    elsewhere = injection.in_other_channels(record, span, inputs.names, missing)
    looks = []
    for n, unit in zip(inputs.names, inputs.units, strict=True):
        here = found.get(n, Gain(0.0, 0.0, 0.0, 1.0))
        achieved, of = _achieved(record, n, span, lines[n])
        effector = next((e for e in vehicle.effectors if e.name == n), None) if vehicle else None
        at_limit, at_rate = _limited(record, n, span, effector)
        looks.append(
            InputLook(
                name=n,
                unit=unit,
                source=injection.source_of(record, n),
                coherence=here.coherence,
                p_value=here.p_value,
                gain=here.gain,
                present=here.p_value < FALSE_ALARM,
                found_on=elsewhere.get(n, ""),
                periods=max(inside, 0.0) / period,
                achieved_of=of,
                achieved_gain=achieved.gain if achieved else float("nan"),
                achieved_lag_s=achieved.lag_s if achieved else float("nan"),
                achieved_coherence=achieved.coherence if achieved else float("nan"),
                at_limit=at_limit,
                at_rate_limit=at_rate,
            )
        )
    return tuple(looks)


def _achieved(record: FlightRecord, name: str, span: slice, lines_hz: Array) -> tuple[Gain | None, str]:
    """Return the position as gain and lag times what was commanded, on the input's own lines."""
    position = f"effector/{name}"
    of = next((f"{g}/{name}" for g in ("command", "excitation") if f"{g}/{name}" in record), "")
    if position not in record or not of or record.channel(of).unit != record.channel(position).unit:
        return None, ""
    both = injection.line_transforms(record.matrix([position, of])[:, span], record.time[span], lines_hz)
    return injection.gain_of(both[0], both[1], lines_hz), of


def _limited(record: FlightRecord, name: str, span: slice, effector: Effector | None) -> tuple[float, float]:
    """Return the shares of the time at a position limit and at the rate limit; nan where none is stated."""
    names = [f"{g}/{name}" for g in ("effector", "command") if f"{g}/{name}" in record]
    names = [n for n in names if effector and record.channel(n).unit == effector.unit]
    if effector is None or not names:
        return float("nan"), float("nan")
    low, high = effector.limits
    slack = 0.005 * (high - low) if np.isfinite(high - low) else 0.0
    at_limit = max(injection.share_at_limit(record[n][span], effector.limits, slack) for n in names)
    if effector.rate_limit is None:
        return at_limit, float("nan")
    # what is commanded tells it best: a position at its rate limit is not faster than that
    return at_limit, injection.share_too_fast(record[names[-1]][span], record.dt, effector.rate_limit)


def _rates(record: FlightRecord, planned: Planned, report: PlausibilityReport) -> tuple[RateLook, ...]:
    """Return how fast the channels that identification uses were logged."""
    slower = {f.channels[0]: float(f.evidence["rate_hz"]) for f in report.findings if f.check == "latched"}
    used = [n for n in record.channels if n.startswith("state/") and n not in _SLOW]
    used += [f"effector/{n}" for n in planned.inputs.names if f"effector/{n}" in record]
    looks = []
    for name in used:
        rate = min(record.channel(name).native_rate_hz, 1 / record.dt, slower.get(name, np.inf))
        looks.append(RateLook(name, rate, planned.band_hz[1] <= 0.5 * rate))
    return tuple(looks)


_SLOW = ("state/alt", "state/vn", "state/ve", "state/vd", "state/psi")  # no regressor has their band


def _parameters(
    record: FlightRecord,
    scenario: Scenario | None,
    planned: Planned,
    start_s: float,
    accuracy: float,
) -> tuple[tuple[ParameterLook, ...], list[str]]:
    """Return the parameters that the scenario's regressors have in this log alone, or why there are none."""
    if scenario is None or scenario.identification is None:
        return (), []
    settings = scenario.identification
    if settings.method in MAXIMUM_LIKELIHOOD:
        settings = msgspec.structs.replace(settings, method="frequency")
    used = scenario.excitation
    if isinstance(planned.design, MultisineDesign) and used is not None:
        used = msgspec.structs.replace(used, period_s=planned.design.period_s, band_hz=planned.design.band_hz)
    try:
        maneuver = maneuver_of(_flown(record, planned, start_s), scenario)
        return _judged(_fitted(maneuver, settings, used), accuracy), []
    except (DataError, UsageError) as error:
        return (), [f"no parameters can be estimated: {error.message}"]


def _fitted(maneuver: Maneuver, settings: Identification, excitation: Any) -> PointModel:
    """Identify; by least squares where the instruments that are asked for were not logged or are too weak."""
    try:
        return point.identify_point(maneuver, settings, excitation=excitation)
    except (DataError, UsageError):
        if settings.estimator == "least-squares":
            raise
        return point.identify_point(maneuver, settings, excitation=excitation, estimator="least-squares")


def _flown(record: FlightRecord, planned: Planned, start_s: float) -> FlightRecord:
    """Cut the record to what the design covers of it."""
    first = max(start_s, float(record.time[0]))
    last = min(start_s + float(planned.inputs.time[-1]), float(record.time[-1]))
    if last - first < 0.5 * float(planned.inputs.time[-1]):
        return record
    return record.cut(first, last)


def _judged(model: PointModel, accuracy: float) -> tuple[ParameterLook, ...]:
    """Hold each standard error against the accuracy asked for."""
    looks = []
    for response in model.responses.values():
        size = float(np.std(response.fit["time"].modelled)) if "time" in response.fit else float("nan")
        contribution = response.std_error * response.regressor_rms / size
        for j, name in enumerate(response.regressors):
            estimate, error = float(response.estimate[j]), float(response.std_error[j])
            looks.append(
                ParameterLook(
                    response=response.response,
                    name=name,
                    unit=f"{response.unit} per {response.regressor_units[j]}",
                    estimate=estimate,
                    std_error=error,
                    contribution_error=float(contribution[j]),
                    met=bool(error <= accuracy * abs(estimate) or contribution[j] <= accuracy),
                )
            )
    return tuple(looks)


def _why_input(planned: Planned, looks: tuple[InputLook, ...], found_at_all: bool) -> Iterator[str]:
    """Yield what is wrong with the inputs."""
    if not found_at_all:
        yield f"the log does not hold the inputs of {planned.name}: another design, or none, was flown"
        return
    for look in (look for look in looks if not look.present):
        where = f"; its signal is on '{look.found_on}'" if look.found_on else ""
        seen = f"coherence {look.coherence:.2f} of '{look.source}'" if look.source else "no channel"
        yield f"the injection on '{look.name}' is not in the log ({seen}{where})"
    periods = max(look.periods for look in looks)
    all_of = float(planned.inputs.time[-1]) / getattr(
        planned.design, "period_s", float(planned.inputs.time[-1])
    )
    if periods < WHOLE * all_of:
        yield f"only {periods:.2g} of {all_of:.2g} periods of the design are in the log"
    for look in (look for look in looks if look.present):
        power = look.achieved_gain**2
        if power < HALF_POWER or look.achieved_coherence < HALF_POWER:
            yield (
                f"'{look.name}' achieved {look.achieved_gain:.2f} of its command with a coherence of "
                f"{look.achieved_coherence:.2f}"
            )
        if look.at_limit > LIMITED:
            yield f"'{look.name}' is at a position limit for {look.at_limit:.1%} of the time"
        if look.at_rate_limit > LIMITED:
            yield f"'{look.name}' is commanded beyond its rate limit for {look.at_rate_limit:.1%} of the time"


def _why_rate(rates: tuple[RateLook, ...], planned: Planned) -> Iterator[str]:
    """Yield channels that are logged too slowly."""
    slow = [look for look in rates if not look.enough]
    if slow:
        names = ", ".join(f"'{look.channel}' at {look.rate_hz:.3g} Hz" for look in slow[:4])
        more = f" and {len(slow) - 4} more" if len(slow) > 4 else ""
        yield (
            f"the design reaches {planned.band_hz[1]:g} Hz, and {names}{more} "
            f"{'tells' if len(slow) == 1 else 'tell'} nothing above half of that rate"
        )


def _why_parameter(parameters: tuple[ParameterLook, ...], accuracy: float) -> Iterator[str]:
    """Yield what has not been told accurately enough."""
    missed = [look for look in parameters if not look.met]
    if missed:
        missed.sort(key=lambda look: -look.contribution_error)
        worst = ", ".join(
            f"{look.response} by {look.name} ({look.std_error / abs(look.estimate):.0%})"
            if look.estimate
            else f"{look.response} by {look.name}"
            for look in missed[:4]
        )
        yield (
            f"{len(missed)} of {len(parameters)} parameters have not met {accuracy:.0%}, the worst {worst}"
        )


def _remarks(
    record: FlightRecord,
    looks: tuple[InputLook, ...],
    report: PlausibilityReport,
    scenario: Scenario | None,
    at: str,
    parameters: tuple[ParameterLook, ...],
) -> Iterator[str]:
    """Yield what is worth knowing; a flight at another condition than stated first."""
    stated = next((r for r in scenario.reference if r.id == at), None) if scenario else None
    if scenario and stated:
        flown = [Maneuver(record, scenario.aircraft())]
        mean = point.flown_reference(flown, stated.scheduled)
        units = point.scheduled_units(flown, stated)
        yield from (text[:-1] for text in point.departures(stated, mean, units))
    for look in looks:
        if look.present and abs(look.gain - 1) > SCALED and look.source.startswith("excitation/"):
            yield f"'{look.name}' was injected at {look.gain:.2f} times the design"
    filled = record.provenance.get("resampled", {}).get("filled_samples") or {}
    total = sum(filled.values()) if isinstance(filled, dict) else int(filled)
    if total:
        yield f"{total} samples were missing in the log and were interpolated"
    yield from (str(f)[:-1] for f in report.warnings)
    if scenario is None or not parameters:
        yield "no parameters were judged: name a scenario with [identification]"

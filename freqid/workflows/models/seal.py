"""A model predicts a flight before it is flown, sealed; the flight is held against it afterwards."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from freqid.blend.global_model import GlobalModel
from freqid.blend.sealed.assumptions import assumptions, warnings
from freqid.blend.sealed.bands import free_run
from freqid.blend.sealed.condition import ModelAtCondition, of_global, of_point
from freqid.blend.sealed.score import Flown, checks, scored_channels
from freqid.core import store
from freqid.core.blas import on_one_thread
from freqid.core.channels import split
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import FlightRecord
from freqid.core.results.design import ClassicDesign, MultisineDesign, SampledInputs
from freqid.core.results.point import PointModel
from freqid.core.results.prediction import FILE, WRENCH_HZ, Prediction, Score, digest_of
from freqid.core.scenario import Reference, Scenario
from freqid.core.vehicle import Vehicle
from freqid.design.forecast.closed_loop import SPECIFIC_FORCES
from freqid.dynamics.control_law import ControlLaw
from freqid.dynamics.controlled import UnevenLags
from freqid.dynamics.small_motion import STATES
from freqid.identify.response.injection import find_start
from freqid.workflows.design import DesignedInputs
from freqid.workflows.inputs import (
    File,
    Flight,
    maneuver_of,
    model_of,
    name_of,
    names_of,
    point_of,
    scenario_of,
)
from freqid.workflows.models.margins import law_of
from freqid.workflows.quicklook import Design, Planned, look_at_inputs, planned_of

HEIGHT_M = 100.0
"""Above ground, where gusts are those of `simulate`."""
GATE = 0.85
"""Lowest mean coverage of a single flight that passes; errors of one flight are alike over its time, so that
the coverage of a flight as predicted scatters about 95 % (docs/predictions.md)."""
NOISY = (
    0.1  # noise over motion of a regressor, of which about a tenth of a tenth is lost to bias on each line
)
FEWEST = 0.5  # of the inputs that must be in a record for it to be one of the design


@on_one_thread
def predict_flight(
    model: PointModel | GlobalModel | File,
    design: Design,
    scenario: Scenario | File,
    *,
    at: str = "",
    sensors: str = "",
    turbulence: float = 0.0,
    residual: PointModel | File | None = None,
    loop: Any = None,
    feedback: bool = True,
    draws: int = 100,
    seed: int = 0,
    date: datetime | None = None,
) -> Prediction:
    """Predict what an aircraft will do when a design is flown, and seal the prediction.

    Parameters
    ----------
    model : PointModel, GlobalModel or path
        Of forces in body axes.
    design : DesignedInputs, MultisineDesign, ClassicDesign, SampledInputs or path
        What will be flown.
    scenario : Scenario, path or name
        Vehicle, control law and actuators, and ``[noise]``.
    at : str
        Reference condition of the scenario, for a global model; a point model has its own.
    sensors : str
        Sensor suite of ``[simulation.sensors]`` whose noise stands in where ``[noise]`` states none.
    turbulence : float
        Wind at 20 ft that gusts go with, m/s, as in `simulate`; zero for none.
    residual : PointModel or path, optional
        Whose residual stands for what a global model leaves.
    loop : path, python-control object, Scenario or callable, optional
        The control law with its actuators in place of the scenario's, as `margins` takes it
        (docs/margins.md).
    feedback : bool
        Without it, the trim's commands are held.
    draws : int
        Models drawn from the covariance.
    seed : int
        Of these.
    date : datetime, optional
        That is sealed in; now where absent.

    Returns
    -------
    Prediction
        The same but for its date for the same arguments.

    Raises
    ------
    UsageError
        Where the design does not fit the model, the free run is unstable, or options do not fit each other.
    DataError
        Where a file cannot be read, the model has no covariance, or the condition is outside the corridor.

    Notes
    -----
    Linear motion about the trim, with actuators and delays by their exact transfer functions
    (docs/theory/sealed-predictions.md).

    Examples
    --------
    >>> sealed = predict_flight("point.h5", "design.h5", "aircraft.toml")  # doctest: +SKIP
    >>> sealed["q"].upper  # doctest: +SKIP
    """
    described = scenario_of(scenario)
    vehicle = described.aircraft()
    planned = planned_of(design)
    found, model_name = model_of(model)
    if draws < 2 or turbulence < 0:
        raise UsageError(
            f"found {draws} draws and turbulence of {turbulence:g} m/s, expected two draws or more and no "
            "negative wind"
        )
    if loop is not None and not feedback:
        raise UsageError(
            "a loop is given that is not to be closed", remedy="leave out --loop or --no-feedback"
        )
    try:
        if isinstance(found, PointModel):
            if at and at != found.reference.id:
                raise UsageError(
                    f"the point model is of '{found.reference.id}', and is asked to predict at '{at}'",
                    remedy="leave --at out, or predict with a global model",
                )
            local = of_point(found, vehicle)
        else:
            if not at:
                first = next((r.id for r in described.reference), "ID")
                raise UsageError(
                    "a global model predicts at a condition, and none is named",
                    remedy=f"choose one with --at, such as --at {first}",
                )
            left = point_of(residual) if residual is not None else None
            local = of_global(found, described.reference_of(at), vehicle, left)
    except (UsageError, DataError) as error:
        raise error.at(model_name) from None
    law, lags, source = flown_law(described, local.reference, local.trim, loop=loop, feedback=feedback)
    _refuse_unfit(planned, law.effectors, vehicle)
    noise = stated_noise(described, sensors)
    aircraft = local.controlled(vehicle, law, lags)
    gusts = None
    if turbulence:
        from freqid.simulate.air.dryden import low_altitude

        gusts = low_altitude(
            turbulence, HEIGHT_M, float(np.linalg.norm(local.velocity)), vehicle.span_m or 1.0
        )
    run = free_run(
        local, aircraft, planned.inputs, planned.band_hz, noise, gusts=gusts, draws=draws, seed=seed
    )
    in_words = f"gusts of a wind of {turbulence:g} m/s at 20 ft" if turbulence else "no gust"
    return Prediction(
        vehicle=vehicle.name,
        reference=local.reference,
        model=model_name,
        model_sha256=_sha256(model),
        model_kind=local.kind,
        design_name=_name(design, "design"),
        design_sha256=_sha256(design),
        inputs=planned.inputs,
        time=run.time,
        highest_hz=float(local.highest_hz),
        channels=run.channels,
        responses=local.responses,
        assumptions=assumptions(local, aircraft.vehicle, any(noise.values()), in_words, source),
        settings={
            # callers may give numpy's integers, which a file of settings does not take
            "seed": int(seed),  # pyrefly: ignore[unnecessary-type-conversion]
            "draws": int(draws),  # pyrefly: ignore[unnecessary-type-conversion]
            "level": 0.95,
            "noise": {n: float(x) for n, x in sorted(noise.items())},
            "turbulence_m_s": float(turbulence),
            WRENCH_HZ: run.wrench_hz,
            "law": source,
            **_loop_file(loop),
            "theta_rad": float(local.theta),
            "scenario": {"file": name_of(described), "sha256": described.sha256},
            "unstable_draws": float(run.unstable_draws),
        },
        remarks=(*_biased(found, noise), *_without_effect(local, law), *warnings(local, run, vehicle)),
        date=(date or datetime.now(UTC)).astimezone(UTC).isoformat(timespec="seconds"),
        design=planned.design if isinstance(planned.design, MultisineDesign) else None,
    ).seal()


def score_prediction(
    prediction: Prediction | File,
    flight: Flight,
    scenario: Scenario | File | None = None,
    *,
    gate: float = GATE,
) -> Score:
    """Hold a flight against the prediction that was sealed before it.

    Parameters
    ----------
    prediction : Prediction or path
    flight : FlightRecord, Maneuver or path
    scenario : Scenario, path or name, optional
        Describes the vehicle; the record's own where absent.
    gate : float
        Lowest mean coverage of each kind, for ``Score.passed``.

    Returns
    -------
    Score

    Raises
    ------
    DataError
        Where the prediction was edited after it was sealed, the record is not one of its design, or says
        that it was flown before the prediction was made.
    UsageError
        Where the gate is no share.

    Examples
    --------
    >>> score = score_prediction("prediction.h5", "flight.h5")  # doctest: +SKIP
    >>> score.coverage, score.failed  # doctest: +SKIP
    ({'free-run': 0.95, 'one-step': 0.95}, ())
    """
    if not 0 <= gate <= 1:
        raise UsageError(f"the gate is {gate:g}, expected a share of the samples such as 0.85")
    name = _name(prediction, "prediction")
    sealed = prediction if isinstance(prediction, Prediction) else FILE.read(Path(prediction))
    if isinstance(prediction, Prediction):
        sealed.refuse_edited()
    where = names_of([flight])[0]
    try:
        maneuver = maneuver_of(flight, scenario_of(scenario) if scenario is not None else None)
        record = maneuver.record
        flown_at = _flown_at(record, flight)
        if flown_at and datetime.fromisoformat(flown_at) < datetime.fromisoformat(sealed.date):
            raise DataError(
                f"was there at {flown_at}, before the prediction was sealed at {sealed.date}",
                remedy="score a flight that was flown after its prediction",
            )
        start = find_start(record, sealed.inputs)
        design: Any = sealed.design or sealed.inputs
        band = sealed.design.band_hz if sealed.design else planned_of(sealed.inputs).band_hz
        planned = Planned(design, sealed.inputs, band, sealed.design_name)
        looks = look_at_inputs(record, planned, maneuver.vehicle, start.time_s) if start else ()
        there = sum(look.present for look in looks)
        if start is None or there < max(1, FEWEST * len(looks)):
            raise DataError(
                f"is no flight of the design '{sealed.design_name}': {there} of "
                f"{len(sealed.inputs.names)} injections are in it",
                remedy="score the record of the flight that was predicted",
            )
        flown = Flown.of(sealed, maneuver, start.time_s)
        return Score(
            prediction=name,
            record=where,
            checksum=sealed.checksum,
            fingerprint=record.fingerprint,
            vehicle=sealed.vehicle,
            date=sealed.date,
            flown=flown_at,
            start_s=start.time_s,
            gate=float(gate),
            channels=scored_channels(sealed, flown),
            checks=checks(sealed, flown, looks, start.time_s),
        )
    except DataError as error:
        raise error.at(where) from None


def flown_law(
    scenario: Scenario,
    reference: Reference,
    trim: Mapping[str, float],
    *,
    loop: Any = None,
    feedback: bool = True,
) -> FlownLaw:
    """Return the law and actuators that an aircraft will fly, over all its effectors.

    Parameters
    ----------
    scenario : Scenario
        ``[control.gains]`` by effector and state; or else the law that `simulate` flies, where
        ``[simulation]`` describes the loads that it is designed for. Actuators are those of
        ``[simulation.actuators]``, or follow at once.
    reference : Reference
    trim : mapping of str to float
        Of effectors, tilts among them.
    loop : optional
        A law with its actuators in place of the scenario's, as `margins` takes it.
    feedback : bool
        False for the trim's commands held; actuators stay.

    Raises
    ------
    UsageError
        Where the law's section is wrong, its condition cannot be trimmed, or `loop` does not fit the vehicle.
    DataError
        Where a loop file cannot be read.
    """
    vehicle = scenario.aircraft()
    lags = None
    if loop is not None:
        law_at, name = law_of(loop, vehicle)
        tilts = {w.tilt: trim[w.tilt] for w in vehicle.wings if w.tilt in trim}
        law = law_at(reference.u, reference.rho, tilts | dict(reference.scheduled))
        source = f"{name.removeprefix('law of ')} with its own actuators"
    elif scenario.simulation.loads:
        law, lags = _simulated_law(scenario, reference)
        source = "[control.gains]" if "gains" in scenario.control else "the simulation ([control.lq])"
        source += f" of {name_of(scenario)}, actuators of [simulation.actuators]"
    else:
        law = _stated_gains(scenario)
        source = f"[control.gains] of {name_of(scenario)}, actuators that follow at once"
        if not law.D.any():
            source = "no feedback, actuators that follow at once"
    if not feedback:
        still = ControlLaw.none(law.effectors)
        law, source = replace(still, actuation=law.actuation), "no feedback"
    return FlownLaw(law.over(tuple(e.name for e in scenario.effector)), lags, source)


class FlownLaw(NamedTuple):
    """A law over all effectors with its actuators, those lags that are uneven, and where it is from."""

    law: ControlLaw
    lags: UnevenLags | None
    source: str


def _simulated_law(scenario: Scenario, reference: Reference) -> tuple[ControlLaw, UnevenLags | None]:
    """Return the law and the actuators that `simulate` flies; lags are over all effectors."""
    from freqid.compare.scenario_law import scenario_law
    from freqid.simulate.fly import DT

    law = scenario_law(scenario)(reference.u, reference.rho, dict(reference.scheduled))
    # commands are held for a frame, which delays them by half of one on average
    actuation = replace(law.actuation, delay=law.actuation.delay + 0.5 * DT)
    law = replace(law, actuation=actuation)
    motor = scenario.simulation.actuators.get("motor", {})
    if not motor:
        return law, None
    rotors = [i for i, e in enumerate(scenario.effector) if e.kind == "rotor"]
    lags = UnevenLags(*np.tile(law.over([e.name for e in scenario.effector]).actuation.lag, (2, 1)))
    lags.up[rotors], lags.down[rotors] = float(motor["rise_s"]), float(motor["fall_s"])
    return law, lags


def _stated_gains(scenario: Scenario) -> ControlLaw:
    """Return ``[control.gains]`` as they stand, without actuators."""
    names, signals = tuple(e.name for e in scenario.effector), (*STATES, "psi")
    gain = np.zeros((len(names), len(signals)))
    for effector, row in scenario.control.get("gains", {}).items():
        for state, value in row.items():
            for known, asked in ((names, effector), (signals, state)):
                if asked not in known:
                    raise UsageError(
                        f"[control.gains] names '{asked}'",
                        where=name_of(scenario),
                        remedy=nearest(asked, known),
                    )
            gain[names.index(effector), signals.index(state)] = float(value)
    return ControlLaw.of_gains(signals, names, gain)


def stated_noise(scenario: Scenario, sensors: str = "") -> dict[str, float]:
    """Return one sigma of a sample by state, effector and ``ax ay az``, as far as it is stated.

    Parameters
    ----------
    scenario : Scenario
        ``[noise]``, by channel or by kind of effector.
    sensors : str
        Suite whose noise stands in where that states none.

    Raises
    ------
    UsageError
        Where there is no such suite.
    """
    table = dict(scenario.noise)
    if sensors:
        from freqid.simulate.sensors import suite

        for sensor in suite(scenario, sensors).values():
            for channel in sensor.channels:
                table.setdefault(split(channel)[1], sensor.noise)
    for effector in scenario.effector:
        if effector.kind in table:
            table.setdefault(effector.name, table[effector.kind])
    used = {*STATES, *SPECIFIC_FORCES, *(e.name for e in scenario.effector)}
    return {n: float(x) for n, x in table.items() if n in used}


def _biased(model: PointModel | GlobalModel, noise: Mapping[str, float]) -> tuple[str, ...]:
    """Return a remark where noise in the regressors biases the model, which no covariance says."""
    if not isinstance(model, PointModel) or model.estimator != "least-squares":
        return ()
    noisy = {
        n: noise[n] / rms
        for r in model.responses.values()
        for n, rms in zip(r.regressors, r.regressor_rms, strict=True)
        if rms > 0 and noise.get(n, 0.0) > NOISY * rms
    }
    if not noisy:
        return ()
    worst = max(noisy, key=lambda n: noisy[n])
    return (
        f"the model is of least squares, and the noise of {worst} is {100 * noisy[worst]:.0f} % of its "
        "motion, which biases estimates by more than the bands hold: identify it by instruments",
    )


def _without_effect(model: ModelAtCondition, law: ControlLaw) -> tuple[str, ...]:
    """Return a remark where the law moves what the model does not know the effect of."""
    known = {n for response in model.responses for n in response.regressors}
    moved = [n for n, row in zip(law.effectors, law.allocation, strict=True) if row.any() and n not in known]
    if not moved:
        return ()
    return (f"the law moves {' '.join(moved)}, of which the model has no derivatives: they do nothing here",)


def _refuse_unfit(planned: Planned, effectors: tuple[str, ...], vehicle: Vehicle) -> None:
    """Refuse a design that excites what the vehicle does not have, or in another unit."""
    for name, unit in zip(planned.inputs.names, planned.inputs.units, strict=True):
        if name not in effectors:
            raise UsageError(
                f"the design excites '{name}', which vehicle '{vehicle.name}' does not have",
                where=planned.name,
                remedy=nearest(name, effectors),
            )
        if vehicle.effector(name).unit != unit:
            raise UsageError(
                f"the design excites '{name}' in {unit}, the vehicle's is in {vehicle.effector(name).unit}",
                where=planned.name,
                remedy="design the inputs with the scenario of this vehicle",
            )


def _name(given: object, otherwise: str) -> str:
    return str(given) if isinstance(given, str | Path) else otherwise


def _sha256(given: Any) -> str:
    """Return the hash of a file's bytes, or of the contents of what was made in Python."""
    if isinstance(given, str | Path):
        return hashlib.sha256(Path(given).read_bytes()).hexdigest()
    if isinstance(given, GlobalModel):
        given = given.corridor
    if isinstance(given, DesignedInputs):
        given = given.inputs
    if isinstance(given, PointModel | MultisineDesign | ClassicDesign | SampledInputs) or hasattr(
        given, "responses"
    ):
        return digest_of(given)
    raise UsageError(f"found {type(given).__name__}, expected a model or a design")


def _loop_file(loop: Any) -> dict[str, Any]:
    """Return file and hash of a law that is in a file, ``FILE.py:NAME`` among them."""
    file, python, _ = str(loop).partition(".py:")
    path = Path(f"{file}.py" if python else file)
    if not isinstance(loop, str | Path) or not path.is_file():
        return {}
    return {"loop": {"file": str(loop), "sha256": _sha256(path)}}


def _flown_at(record: FlightRecord, given: object) -> str:
    """Return when a record says that it was flown; when its file was written, where it does not say."""
    said = str(record.provenance.get("flown_utc", ""))
    if said:
        try:
            return datetime.fromisoformat(said).astimezone(UTC).isoformat(timespec="seconds")
        except ValueError:
            raise DataError(
                f"states that it was flown at '{said}', expected a date such as 2026-05-04T09:30:00+00:00",
                remedy="correct the provenance's flown_utc",
            ) from None
    if not isinstance(given, str | Path):
        return ""
    with h5py.File(given, "r") as file:
        return store.get_text(file, "created")

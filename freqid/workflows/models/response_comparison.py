"""Measured responses beside those of a model and of a simulation, and parametric models fitted to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import msgspec
import numpy as np

from freqid.blend.global_model import GlobalModel
from freqid.blend.state_space import StateSpace
from freqid.core.arrays import Array, Complex
from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.core.results.frequency_response import ComparedResponse, FittedResponse, FrequencyResponse
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference, Scenario
from freqid.design.forecast.modelled import derivatives_of, positions_at
from freqid.dynamics.small_motion import STATES
from freqid.gap.fidelity import frequency_cost, muad
from freqid.identify.loads.explanatory import history
from freqid.identify.output_error.forms.form import parted
from freqid.identify.output_error.point_model import ready_model
from freqid.identify.output_error.response_fit import fit_model, fit_transfer_function
from freqid.identify.output_error.signals import signals_of
from freqid.workflows.inputs import identification_of

COHERENT = 0.6
"""Partial coherence from which a response enters cost and mismatch: Tischler & Remple, 2nd ed., sec. 2.6."""


def compared_with_model(
    response: FrequencyResponse,
    model: PointModel | GlobalModel,
    source: str,
    maneuvers: Sequence[Maneuver],
    reference: Reference | None,
) -> FrequencyResponse:
    """Add the response of a point model or a global model, linearised about the flights' condition.

    Raises
    ------
    UsageError
        Where the model is not one of all forces and moments in N and N m, or a global model has no condition.
    DataError
        Where it has none of the responses.
    """
    flown = maneuvers[0]
    if isinstance(model, GlobalModel):
        if reference is None:
            raise UsageError(
                "a global model needs the condition that was flown, which the records do not name",
                remedy="give a --scenario whose reference the records were flown at",
            )
        space = model.to_statespace(reference, flown.vehicle)
        at = {n: [space.trim[n]] for n in model.inputs if n in space.trim}
        at |= {"u": [reference.u], "rho": [reference.rho]}
        gradient = model.gradient(at)[[model.names.index(r) for r in WRENCH], :, 0]
        derivatives = dict(zip(model.inputs, gradient.T, strict=True))
    else:
        rows = derivatives_of(model)
        regressors = tuple(dict.fromkeys(x for row in rows.values() for x in row))
        derivatives = {
            x: np.array([rows.get(r, {}).get(x, 0.0) for r in WRENCH])
            for x in regressors
            if x in STATES or x in flown.vehicle.effector_kinds
        }
        trim = {
            n: float(x)
            for r in model.responses.values()
            for n, x in zip(r.regressors, r.trim, strict=True)
            if n in flown.vehicle.effector_kinds
        }
        level = {n: float(np.mean(history(flown, n))) for n in ("u", "v", "w", "theta")}
        trim = {**positions_at(model.reference, flown.vehicle), **trim, **level}
        space = StateSpace.of(derivatives, trim, flown.vehicle)
    speed = (space.trim["u"], space.trim["w"])
    found = _linear(response, space.A, space.B, space.states, space.inputs, derivatives, speed)
    return _with(response, "model", source, found)


def compared_with_simulation(
    response: FrequencyResponse, scenario: Scenario, source: str, at: str
) -> FrequencyResponse:
    """Add the linearised response of a scenario's simulation: wakes steady, effectors moving at will.

    Raises
    ------
    UsageError
        Where the scenario has no such condition, or it cannot be trimmed.
    DataError
        Where it has none of the responses.
    """
    import jax

    from freqid.simulate.control.linearize import linearize
    from freqid.simulate.control.trim import trim
    from freqid.simulate.motion import whole_vehicle as motion

    if not at:
        raise UsageError(
            "the records do not name the condition that they were flown at, so that the simulation cannot be "
            "linearised there",
            remedy="import them with their reference, or name it in the records",
        )
    parameters = jax.device_put(motion.parameters(scenario))
    trimmed = trim(scenario, parameters, scenario.reference_of(at))
    linear = linearize(scenario, parameters, trimmed)
    states = (*STATES, "psi")
    columns = dict(zip((*STATES[:6], *linear.effectors), linear.wrench.T, strict=True))
    velocity = np.asarray(trimmed.body.velocity)
    speed = (float(velocity[0]), float(velocity[2]))
    found = _linear(response, linear.A, linear.B, states, linear.effectors, columns, speed)
    return _with(response, "simulation", source, found)


def fitted(
    response: FrequencyResponse,
    fits: Sequence[str],
    maneuvers: Sequence[Maneuver],
    scenario: Scenario | None,
    band_hz: tuple[float, float] | None,
) -> FrequencyResponse:
    """Add fits: transfer functions ``M/N`` of every pair, or ``state-space`` of the scenario's ready forms.

    Raises
    ------
    UsageError
        For something else, or a ready form without a scenario.
    DataError
        Where a fit is not found.
    """
    found: list[FittedResponse] = []
    for word in fits:
        if word == "state-space":
            found += _forms(response, maneuvers, scenario, band_hz)
            continue
        above, slash, below = word.partition("/")
        if not (slash and above.isdigit() and below.isdigit()):
            raise UsageError(
                f"fit '{word}' is neither orders M/N of a transfer function nor state-space",
                remedy="write for example 1/2",
            )
        found += [
            fit_transfer_function(response, o, i, int(above), int(below), band_hz=band_hz)
            for o in response.outputs
            for i in response.inputs
        ]
    return replace(response, fits=(*response.fits, *(_with_cost(response, one) for one in found)))


def _forms(
    response: FrequencyResponse,
    maneuvers: Sequence[Maneuver],
    scenario: Scenario | None,
    band_hz: tuple[float, float] | None,
) -> list[FittedResponse]:
    if scenario is None:
        raise UsageError(
            "a state-space fit needs the responses and regressors of a scenario", remedy="give --scenario"
        )
    identification = identification_of(scenario)
    found, why = [], None
    for responses in parted(identification.responses, identification.form):
        part = msgspec.structs.replace(identification, responses=responses)
        model = ready_model(maneuvers, part, None)
        given = [signals_of(m, model) for m in maneuvers]
        about = {
            n: float(np.mean([np.mean(s.inputs[n] if n in s.inputs else s.outputs[n]) for s in given]))
            for n in (*model.inputs, *model.states)
            if all(n in s.inputs or n in s.outputs for s in given)
        }
        try:
            found.append(fit_model(response, model, about, band_hz=band_hz))
        except UsageError as error:
            why = error
    if not found and why is not None:
        raise why
    return found


def _linear(
    response: FrequencyResponse,
    A: Array,
    B: Array,
    states: Sequence[str],
    effectors: Sequence[str],
    derivatives: Mapping[str, Array],
    speed: tuple[float, float],
) -> Complex:
    """Return what a linear model has for each output and input, nan where it has none, shape (o, n, M)."""
    s = 2j * np.pi * response.frequencies_hz
    known = [i for i, n in enumerate(response.inputs) if n in effectors]
    columns = [list(effectors).index(response.inputs[i]) for i in known]
    motion = np.linalg.solve(s[:, None, None] * np.eye(len(A)) - A, B[:, columns].astype(complex)).transpose(
        1, 2, 0
    )
    rows: dict[str, Complex] = {n: motion[k] for k, n in enumerate(states)}
    u, w = speed
    square = u**2 + w**2
    if square > 0:
        rows["alpha"] = (u * rows["w"] - w * rows["u"]) / square
        rows["beta"] = rows["v"] / np.sqrt(square)
        rows["V"] = (u * rows["u"] + w * rows["w"]) / np.sqrt(square)
    for k, name in enumerate(WRENCH):
        moving = sum(derivatives[n][k] * rows[n] for n in STATES[:6] if n in derivatives)
        held = np.array([derivatives[response.inputs[i]][k] for i in known])
        rows[name] = moving + held[:, None]
    found = np.full(response.value.shape, np.nan + 0j)
    for o, output in enumerate(response.outputs):
        bare = output.removeprefix("state/").removeprefix("air/")
        if bare in rows:
            found[o, known] = rows[bare]
    return found


def _with(response: FrequencyResponse, name: str, source: str, value: Complex) -> FrequencyResponse:
    """Add what was found, with cost and mismatch of every pair."""
    lost = [n for k, n in enumerate(response.outputs) if np.isnan(value[k]).all()]
    alone = [n for k, n in enumerate(response.inputs) if np.isnan(value[:, k]).all()]
    if len(lost) == len(response.outputs):
        raise DataError(
            f"the {name} has none of the responses of {', '.join(lost)} to {', '.join(response.inputs)}",
            where=source,
            remedy="ask for velocities, rates, angles or X Y Z L M N, and for effectors that it has",
        )
    remarks = [f"The {name} has no {' '.join(x)}." for x in (lost, alone if not lost else []) if x]
    shape = response.value.shape[:2]
    cost, inside = np.full(shape, np.nan), np.full(shape, np.nan)
    f = response.frequencies_hz
    for o, i in np.ndindex(shape):
        trust, flown = _coherent(response, o, i)
        cost[o, i] = frequency_cost(f, flown, value[o, i], trust)
        mismatch = muad(f, flown, value[o, i]).inside
        inside[o, i] = np.mean(mismatch) if mismatch.size else np.nan
    compared = ComparedResponse(name, source, value, cost, inside)
    return replace(response, compared=(*response.compared, compared), remarks=(*response.remarks, *remarks))


def _coherent(response: FrequencyResponse, o: int, i: int) -> tuple[Array, Complex]:
    """Return one pair's partial coherence, and its response where that is high enough to judge, else nan."""
    trust = np.clip(response.partial_coherence[o, i], 0.0, 1.0)
    return trust, np.where(trust >= COHERENT, response.value[o, i], np.nan)


def _with_cost(response: FrequencyResponse, one: FittedResponse) -> FittedResponse:
    """Return a fit with its mean J, over the band that was fitted."""
    part = response.of(one.inputs, one.outputs)
    f = part.frequencies_hz
    band = (f >= one.band_hz[0]) & (f <= one.band_hz[1])
    costs = []
    for o, i in np.ndindex(part.value.shape[:2]):
        trust, flown = _coherent(part, o, i)
        costs.append(frequency_cost(f[band], flown[band], one.value[o, i, band], trust[band]))
    return replace(one, cost=float(np.nanmean(costs)) if np.isfinite(costs).any() else float("nan"))

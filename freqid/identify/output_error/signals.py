"""The signals of a model from a manoeuvre: channels, computed variables, means, constants of the vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.identify.loads.explanatory import history
from freqid.identify.loads.momentum import rotor_momentum
from freqid.identify.loads.wrench import applied_wrench
from freqid.identify.output_error.model import DynamicModel, Signals
from freqid.identify.spectra.smoothing import local_derivative

ACCELERATIONS = {"ax": "X", "ay": "Y", "az": "Z"}
_LENGTHS = ("area_m2", "span_m", "chord_m")
_MOMENTUM = ("hx", "hy", "hz")
_INERTIA = ("Ixx", "Iyy", "Izz", "Ixz")
_AT_REST = ("phi", "theta", "v", "p", "q", "r")
"""Inputs that are taken to be zero where they were not logged: motion of the other plane."""


def signals_of(
    maneuver: Maneuver, model: DynamicModel, channels: Mapping[str, str] | None = None, name: str = ""
) -> Signals:
    """Return what a manoeuvre gives a model.

    Parameters
    ----------
    maneuver : Maneuver
    model : DynamicModel
        Names of inputs and outputs are channels without their group, variables that are computed from them
        (``phat``), ``trim_x`` for the mean of x, the rotors' angular momentum ``hx hy hz`` and ``hx_rate``
        and so on, or the vehicle's ``mass_kg``, ``Ixx`` to ``Ixz``,
        ``area_m2``, ``span_m`` and ``chord_m``. Velocities, flow angles and ``ax ay az`` are those of the
        centre of gravity. States that are no outputs are given where they are measured.
    channels : mapping of str to str, optional
        Where the model's names are others: ``{"elevator": "effector/de"}``.
    name : str
        Of the manoeuvre, for errors.

    Raises
    ------
    DataError
        Where something is neither logged nor computable nor stated.
    """
    given = dict(channels or {})

    def wanted(names: Sequence[str], *, level: bool) -> dict[str, Array | float]:
        found: dict[str, Array | float] = {}
        for each in names:
            try:
                found[each] = _signal(maneuver, given.get(each, each))
            except DataError:
                if not (level and each in _AT_REST):
                    raise
                found[each] = 0.0
        return found

    try:
        inputs = wanted([n for n in model.inputs if n not in model.rates], level=True)
        outputs = wanted(model.outputs, level=False)
    except DataError as error:
        raise error.at(name) if name else error from None
    for state in model.states:
        if state not in outputs:
            try:
                outputs[state] = _signal(maneuver, given.get(state, state))
            except DataError:
                continue
    record = maneuver.record
    histories = {n: np.broadcast_to(v, record.time.shape).astype(float) for n, v in outputs.items()}
    return Signals(record.dt, inputs, histories, float(record.time[0]), name)


def _signal(maneuver: Maneuver, name: str) -> Array | float:
    vehicle = maneuver.vehicle
    if name.startswith("trim_"):
        return float(np.mean(_signal(maneuver, name.removeprefix("trim_"))))
    if name == "mass_kg":
        return vehicle.mass_properties.mass_kg
    if name in _INERTIA:
        return getattr(vehicle.mass_properties.inertia, name[1:])
    if name in _LENGTHS:
        value = getattr(vehicle, name)
        if value is None:
            raise DataError(
                f"the model needs {name} of vehicle '{vehicle.name}', which is not stated",
                remedy=f"add {name} to [vehicle] of the scenario",
            )
        return value
    if name.removesuffix("_rate") in _MOMENTUM:
        h = rotor_momentum(maneuver)[_MOMENTUM.index(name.removesuffix("_rate"))]
        return np.asarray(local_derivative(h[None], maneuver.record.dt)[0]) if name.endswith("_rate") else h
    if name in maneuver.record:
        return maneuver.record[name]
    if name in ACCELERATIONS and f"state/{name}" in maneuver.record:
        return applied_wrench(maneuver, [ACCELERATIONS[name]], "specific").history(maneuver.record.dt)[0]
    return history(maneuver, name)

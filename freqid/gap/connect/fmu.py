"""A Functional Mock-up Unit (FMI 2.0, co-simulation) as a simulation: ``MODEL.fmu``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import RESPONSE, STATE
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.gap.connect import answers
from freqid.gap.connect.callable import arguments
from freqid.gap.connect.differences import by_parameters, central
from freqid.gap.simulation import Departures, Settings, Tolerance, checked_departures


@dataclass(frozen=True, eq=False)
class FmuSimulation:
    """An FMU that is stepped along the record; methods as in `freqid.gap.simulation.Simulation`.

    Its inputs are named as channels, ``state.u`` or ``u``, ``effector.de1`` or ``de1``, ``air.rho`` or
    ``rho``; its outputs as responses, ``X`` or ``response.X``, or as states. With inputs ``command.de1``
    and outputs ``effector.de1`` it has actuators. Each step ends at a sample and is taken with that
    sample's inputs, so that an algebraic model answers without delay.

    Attributes
    ----------
    file : Path
    name : str
    responses : tuple of str
    inputs, outputs : dict of int
        Value references by name, as the FMU describes them.
    description
        Of the FMU, as fmpy reads it.
    folder : str
        Where it is unpacked.
    vehicle : Vehicle or None
    """

    file: Path
    name: str
    responses: tuple[str, ...]
    inputs: dict[str, int]
    outputs: dict[str, int]
    description: Any
    folder: str
    vehicle: Vehicle | None = None
    kind: Literal["fmu"] = "fmu"
    effects: Settings = field(default_factory=dict)
    parts: tuple[str, ...] = ()
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    can_fly: bool = False
    gyroscopic: bool | None = None

    @property
    def has_actuators(self) -> bool:
        """Whether it has inputs ``command.<name>`` and outputs ``effector.<name>``."""
        made = any(n.startswith("effector.") for n in self.outputs)
        return made and any(n.startswith("command.") for n in self.inputs)

    def predict(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> Array:
        """Return the responses, shape (response, sample)."""
        self._nothing_to_set(effects, departures)
        given = self._given(record)
        lacking = [n for n in self.inputs if n not in given and not n.startswith("command.")]
        if lacking:
            raise DataError(
                f"the record has no channel for input '{lacking[0]}' of the FMU",
                where=self.name,
                remedy="name its inputs as the record's channels: state.u, effector.de1, air.rho",
            )
        outputs = [
            next(n for n in (f"response.{r}", f"state.{r}", r) if n in self.outputs) for r in self.responses
        ]
        rows = self._stepped(record.time, given, outputs)
        predicted = dict(zip(self.responses, rows, strict=True))
        names, rows = answers.stacked(predicted, record.time, self.name, self.responses)
        answers.check_moving(names, rows, record, self.name)
        return rows

    def sensitivity(
        self, record: FlightRecord, sizes: Departures, departures: Departures | None = None
    ) -> Array:
        """Return what departures of its own parameters make, shape (parameter, response, sample)."""
        return by_parameters(self.predict, record, sizes, departures)

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return derivatives by central differences, shape (response, input, sample)."""
        return central(self.predict, record, inputs)

    def positions(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return its outputs ``effector.<name>`` at the record's commands; empty where it has none."""
        self._nothing_to_set(effects, departures)
        names = [n for n in record.group("command") if f"effector.{n}" in self.outputs]
        given = self._given(record)
        if not names or not any(n.startswith("command.") for n in given):
            return {}
        rows = self._stepped(record.time, given, [f"effector.{n}" for n in names])
        return {n: answers.row(r, n, record.time, self.name) for n, r in zip(names, rows, strict=True)}

    def fly(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> None:
        """Return nothing: an FMU is stepped along what was flown."""

    def _nothing_to_set(self, effects: Settings | None, departures: Departures | None) -> None:
        checked_departures(departures, self.tolerances, self.name)
        if effects:
            raise UsageError("an FMU has no effects that could be set", where=self.name)

    def _given(self, record: FlightRecord) -> dict[str, Array]:
        """Return the record's signal by the input that is named after it; other inputs are left out."""
        state, effector, air = arguments(record, self.vehicle)
        command = {n: record[f"command/{n}"] for n in record.group("command")}
        tables = {"state": state, "effector": effector, "air": air, "command": command}
        signals = {**effector, **air, **state}  # without a group: states first, then air
        signals |= {f"{group}.{n}": x for group, table in tables.items() for n, x in table.items()}
        return {n: signals[n] for n in self.inputs if n in signals}

    def _stepped(self, time: Array, given: dict[str, Array], outputs: Sequence[str]) -> Array:
        from fmpy.fmi2 import FMU2Slave  # type: ignore[import-not-found]

        description = self.description
        references = [self.inputs[n] for n in given]
        wanted = [self.outputs[n] for n in outputs]
        values = np.array(list(given.values())).reshape(len(given), time.size)
        unit = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="freqid",
        )
        rows = np.empty((len(outputs), time.size))
        k = 0
        try:
            unit.instantiate()
            unit.setupExperiment(startTime=float(time[0]))
            unit.enterInitializationMode()
            unit.setReal(references, values[:, 0].tolist())
            unit.exitInitializationMode()
            rows[:, 0] = unit.getReal(wanted)
            for k in range(1, time.size):
                unit.setReal(references, values[:, k].tolist())
                step = float(time[k] - time[k - 1])
                unit.doStep(currentCommunicationPoint=float(time[k - 1]), communicationStepSize=step)
                rows[:, k] = unit.getReal(wanted)
            unit.terminate()
        except Exception as error:
            raise DataError(
                f"the FMU failed at t = {time[k]:.4g} s: {type(error).__name__}: {error}", where=self.name
            ) from error
        finally:
            unit.freeInstance()
        return rows


def load(file: Path, vehicle: Vehicle | None = None) -> FmuSimulation:
    """Load an FMU.

    Raises
    ------
    DataError
        Where there is no such file, fmpy is not installed, or it is no FMI 2.0 unit for co-simulation on
        this machine with an output that is a response or a state.
    """
    where = str(file)
    if not file.is_file():
        raise DataError("there is no such file", where=where, remedy="check the path")
    try:
        import fmpy  # type: ignore[import-not-found]
    except ImportError:
        raise DataError(
            "FMUs need fmpy, which is not installed", where=where, remedy="pip install 'freqid[fmu]'"
        ) from None
    try:
        description = fmpy.read_model_description(where)
        platforms, folder = fmpy.supported_platforms(where), fmpy.extract(where)
    except Exception as error:
        raise DataError(f"is no FMU ({error})", where=where, remedy="export it again") from error
    if fmpy.platform not in platforms:
        raise DataError(
            f"has no binary for {fmpy.platform}, only for {', '.join(platforms) or 'none'}",
            where=where,
            remedy=f"export it for {fmpy.platform}",
        )
    if description.coSimulation is None or not description.fmiVersion.startswith("2."):
        raise DataError(
            f"is FMI {description.fmiVersion} without co-simulation or another version than 2.0",
            where=where,
            remedy="export it as FMI 2.0 for co-simulation",
        )
    variables = [v for v in description.modelVariables if v.type == "Real"]
    inputs = {v.name: v.valueReference for v in variables if v.causality == "input"}
    outputs = {v.name: v.valueReference for v in variables if v.causality == "output"}
    short = {n.removeprefix("response.").removeprefix("state.") for n in outputs}
    responses = tuple(n for n in (*RESPONSE, *STATE) if n in short)
    if not responses:
        raise DataError(
            "has no output that is a response or a state",
            where=where,
            remedy="name its outputs X, Y, Z, L, M, N or as states, such as q",
        )
    unknown = [
        n for n in inputs if "." in n and n.partition(".")[0] not in ("state", "effector", "air", "command")
    ]
    if unknown:
        raise DataError(
            f"input '{unknown[0]}' is named after no channel",
            where=where,
            remedy="name inputs state.u, air.rho, effector.<name> or command.<name>",
        )
    return FmuSimulation(file, where, responses, inputs, outputs, description, folder, vehicle)

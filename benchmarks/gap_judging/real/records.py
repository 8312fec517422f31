"""Records of real flights from arrays in SI units, and the scenario that describes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import KNOWN
from freqid.core.record import Channel, FlightRecord
from freqid.core.vehicle import Effector, MassProperties, Rotor, Vehicle
from freqid.dynamics.frames import body_velocity

Array = NDArray[np.float64]

REPOSITORY = Path(__file__).resolve().parents[3]
DATA = REPOSITORY.parent / "shared" / "data"
# One sigma of an owner's knowledge of mass and of moments of inertia, as fractions.
MASS_SIGMA, INERTIA_SIGMA = 0.015, 0.03


class AbsentData(Exception):
    """The flight data of an aircraft are not on this computer."""


def data_file(*parts: str) -> Path:
    """Return a data file's path.

    Raises
    ------
    AbsentData
        Where it is not there; the data are not part of the repository.
    """
    path = DATA.joinpath(*parts)
    if not path.exists():
        raise AbsentData(
            f"{Path('..') / 'shared' / 'data' / Path(*parts)} is absent; the data are not included"
        )
    return path


@dataclass(frozen=True)
class Flight:
    """One flight or segment of an aircraft.

    Attributes
    ----------
    name : str
    record : FlightRecord
        With the vehicle in it.
    """

    name: str
    record: FlightRecord

    def segment(self, label: str, start: float, stop: float) -> Flight:
        """Return the samples from `start` to `stop`, s from the first one, as a flight of its own."""
        first = float(self.record.time[0])
        last = float(self.record.time[-1])
        record = self.record.cut(first + start, min(first + stop, last))
        return Flight(f"{self.name}_{label}", replace(record, time=record.time - record.time[0]))


def make_record(
    time: Array,
    values: Mapping[str, Array],
    vehicle: Vehicle,
    source: str,
    reference: str,
    units: Mapping[str, str] | None = None,
) -> FlightRecord:
    """Return a record whose clock starts at zero.

    Parameters
    ----------
    time : ndarray, shape (sample,)
    values : mapping of str to ndarray
        By ``group/name``, SI.
    vehicle : Vehicle
    source : str
        What the channels say of where they come from.
    reference : str
        Id of the reference condition.
    units : mapping of str to str, optional
        Of channels that are neither states, air data nor surfaces.
    """
    rate = (time.size - 1) / float(time[-1] - time[0])
    kinds = {e.name: e.unit for e in vehicle.effectors}
    channels = {}
    for name, x in values.items():
        group, _, short = name.partition("/")
        unit = (units or {}).get(name) or (KNOWN[group][short][0] if group in KNOWN else kinds[short])
        channels[name] = Channel(name, unit, np.asarray(x, dtype=float), rate, source)
    clock = np.arange(time.size) / rate
    return FlightRecord(clock, channels, vehicle=vehicle, reference=reference)


def with_flow(values: dict[str, Array]) -> dict[str, Array]:
    """Return channels with u v w added, of V alpha beta, and qbar where it is not logged."""
    velocity = body_velocity(values["air/V"], values["air/alpha"], values["air/beta"])
    added = dict(zip(("state/u", "state/v", "state/w"), velocity, strict=True))
    qbar = values.get("air/qbar", 0.5 * values["air/rho"] * values["air/V"] ** 2)
    return {**added, **values, "air/qbar": qbar}


def surfaces(*names: str, limit: float = 0.5) -> tuple[Effector, ...]:
    """Return surfaces with symmetric limits, rad (assumed)."""
    return tuple(Effector(name=n, kind="surface", limits=(-limit, limit)) for n in names)


def _inline(pairs: Mapping[str, float]) -> str:
    return "{ " + ", ".join(f"{k} = {v:.9g}" for k, v in pairs.items()) + " }"


def _inertia(mass: MassProperties) -> dict[str, float]:
    about = mass.inertia
    return {k: getattr(about, k) for k in ("xx", "yy", "zz", "xz")}


def scenario_text(record: FlightRecord, identification: str, knows_mass: bool = True) -> str:
    """Return the minimal scenario of a record, TOML.

    Parameters
    ----------
    record : FlightRecord
        Its vehicle, and the mean speed and density as reference condition.
    identification : str
        Section ``[identification]``, ready to write.
    knows_mass : bool
        Whether uncertainties of mass and inertia are stated.
    """
    vehicle = record.vehicle
    mass = vehicle.mass_properties
    body = _inertia(mass)
    lines = [
        "[vehicle]",
        f'name = "{vehicle.name}"',
        f"mass_kg = {mass.mass_kg:.9g}",
        f"inertia = {_inline(body)}",
    ]
    if knows_mass:
        sigma = {k: INERTIA_SIGMA * body[k] for k in ("xx", "yy", "zz")}
        sigma["xz"] = 0.1 * abs(body["xz"])
        lines += [f"mass_sigma_kg = {MASS_SIGMA * mass.mass_kg:.6g}", f"inertia_sigma = {_inline(sigma)}"]
    for key in ("area_m2", "span_m", "chord_m"):
        if getattr(vehicle, key) is not None:
            lines.append(f"{key} = {getattr(vehicle, key):.9g}")
    for each in vehicle.effectors:
        lines += ["", "[[effector]]", f'name = "{each.name}"', f'kind = "{each.kind}"']
        lines.append(f"limits = [{each.limits[0]:g}, {each.limits[1]:g}]")
    for rotor in vehicle.rotors:
        lines += _rotor_lines(rotor)
    speed, rho = float(record["state/u"].mean()), float(record["air/rho"].mean())
    lines += ["", "[[reference]]", f'id = "{record.reference}"', f"u = {speed:.6g}", f"rho = {rho:.6g}"]
    return "\n".join([*lines, "", identification.strip(), ""])


def _rotor_lines(rotor: Rotor) -> list[str]:
    return [
        "",
        "[[rotor]]",
        f'name = "{rotor.name}"',
        f"spin = {rotor.spin}",
        f"inertia = {rotor.inertia:.6g}",
        f"axis = {list(rotor.axis)}",
        f"position_m = {list(rotor.position_m)}",
        f"diameter_m = {rotor.diameter_m:g}",
    ]


def say(text: str) -> None:
    """Print a line at once."""
    print(text, flush=True)

"""A scenario: one TOML file that says which aircraft, which conditions, what is done and what suffices."""

from __future__ import annotations

import hashlib
import re
import tomllib
from math import inf, isfinite
from pathlib import Path
from typing import Any, Literal, TypeVar

import msgspec

from .channels import WRENCH
from .errors import DataError, UsageError, nearest
from .vehicle import Effector, Inertia, MassProperties, Rotor, Strict, Vector, Vehicle, Wing

T = TypeVar("T")
S = TypeVar("S", bound=Strict)


class Airframe(Strict, frozen=True):
    """Section ``[vehicle]``: mass properties and reference lengths, SI."""

    name: str
    mass_kg: float
    inertia: Inertia
    cg_m: Vector = (0.0, 0.0, 0.0)
    mass_sigma_kg: float = 0.0
    cg_sigma_m: Vector = (0.0, 0.0, 0.0)
    inertia_sigma: Inertia | None = None
    tilt_rad: dict[str, float] = msgspec.field(default_factory=dict)
    area_m2: float | None = None
    span_m: float | None = None
    chord_m: float | None = None


class Reference(Strict, frozen=True):
    """One ``[[reference]]``: the condition that a point model holds at.

    Attributes
    ----------
    id : str
    u : float
        Forward speed, m/s; nan in a model whose record does not tell.
    rho : float
        Air density, kg/m3; likewise.
    dw1, dw2 : float
        Front and rear wing tilt, rad.
    """

    id: str
    u: float
    rho: float
    dw1: float = 0.0
    dw2: float = 0.0


class FrequencyGrid(Strict, frozen=True):
    """Lines from `start` to `stop`, both included, every `step`, Hz."""

    start: float
    step: float
    stop: float

    def __post_init__(self) -> None:
        if not (self.step > 0 and 0 < self.start <= self.stop):
            raise ValueError(
                f"found start {self.start:g}, step {self.step:g}, stop {self.stop:g} Hz, "
                "expected 0 < start <= stop and step > 0"
            )


class Excitation(Strict, frozen=True):
    """Section ``[excitation]``: the multisines that are flown.

    Attributes
    ----------
    band_hz : tuple of 2 floats
    period_s : float
        Fundamental period T; the harmonics are multiples of 1/T.
    periods : int
        How many are flown; two or more leave lines that measure noise.
    amplitude : float or dict
        In effector units, for all or by effector: of the single sine that has the signal's rms.
    effectors : tuple of str, optional
        Those that are excited; where absent, those that `amplitude` names, or all but tilts.
    allocation : {"interleaved", "propulsors-low"} or dict
        Who gets which harmonic: dealt out in turn; the same with rotors confined to the lower part of
        the band; or lists of harmonic numbers by effector.
    propulsor_share : float
        Part of the band's harmonics, from its low end, that rotors are confined to.
    empty : tuple of int
        Harmonic numbers left without power, which then show nonlinearity and noise.
    forbidden_hz : tuple of (low, high)
        Bands kept clear, for example of structural modes.
    power_db : float
        Power of each harmonic may differ from `spectrum` by so much, to lower the peaks.
    spectrum : tuple of (Hz, power), optional
        Relative power, linear between the points; flat where absent.
    dt_s : float
        Interval at which the signals are sampled.
    starts : int
        Random starts of the search for phases, by effector.
    net_load : dict
        Importance of the net peak of each axis, X to N; axes that are not named do not count.
    fade_s : tuple of 2 floats, optional
        Times in which the flight software fades the signals in and out, for the test card.
    abort : dict
        Largest deviation from the trim by state, SI, at which a run is broken off, for the test card.
    """

    band_hz: tuple[float, float]
    period_s: float
    periods: int = 2
    amplitude: float | dict[str, float] = 1.0
    effectors: tuple[str, ...] | None = None
    allocation: Literal["interleaved", "propulsors-low"] | dict[str, tuple[int, ...]] = "interleaved"
    propulsor_share: float = 0.7
    empty: tuple[int, ...] = ()
    forbidden_hz: tuple[tuple[float, float], ...] = ()
    power_db: float = 0.0
    spectrum: tuple[tuple[float, float], ...] | None = None
    dt_s: float = 0.02
    starts: int = 20
    net_load: dict[Literal["X", "Y", "Z", "L", "M", "N"], float] = msgspec.field(default_factory=dict)
    fade_s: tuple[float, float] | None = None
    abort: dict[str, float] = msgspec.field(default_factory=dict)

    def __post_init__(self) -> None:
        low, high = self.band_hz
        if not 0 < low < high:
            raise ValueError(f"band_hz is {list(self.band_hz)}, expected 0 < low < high")
        for name in ("period_s", "dt_s"):
            if not 0 < getattr(self, name) < inf:
                raise ValueError(f"{name} is {getattr(self, name):g}, expected a positive time")
        if high > 0.5 / self.dt_s:
            raise ValueError(
                f"band_hz reaches {high:g} Hz, above the Nyquist frequency of dt_s = {self.dt_s:g} s; "
                f"expected at most {0.5 / self.dt_s:g} Hz, or a dt_s of at most {0.5 / high:.4g} s"
            )
        if self.periods < 1 or self.starts < 1:
            raise ValueError("periods and starts are counts, expected at least 1")
        if not 0 <= self.power_db <= 20:
            raise ValueError(f"power_db is {self.power_db:g}, expected 0 to 20")
        if not 0 < self.propulsor_share <= 1:
            raise ValueError(f"propulsor_share is {self.propulsor_share:g}, expected above 0 and at most 1")


class Identification(Strict, frozen=True):
    """Section ``[identification]``: what is regressed on what, and how.

    Attributes
    ----------
    responses : tuple of str
        Among X Y Z L M N.
    regressors : tuple of str, or dict
        Channel names without group (``u``, ``beta``, ``phat``, ``de1``); for all responses, or by response.
    frequencies_hz : FrequencyGrid or tuple of float, optional
        Lines of the regression; the harmonics of ``[excitation]`` where absent.
    method : {"frequency", "time"}
    form : {"force", "specific", "coefficient"}
    axes : {"body", "stability"}
    trend : {"endpoints", "line", "mean", "none"}, optional
        What is removed before the transform: the line of least squares where absent. In the time
        domain only a bias is estimated, or a bias and a slope with ``"endpoints"`` or ``"line"``.
    angular_acceleration : {"transform", "record"}
        Whether moments take the rates' derivative exactly in the transform or from pdot, qdot, rdot.
    response_source : {"reconstruct", "record"}
        Whether responses are reconstructed from motion and mass, or read from ``response/...``.
    nuisance : {"auto", "constant", "none"}
        Columns that absorb end samples and trend on the lines; ``"constant"`` is one column of ones.
    residuals : {"coloured", "white"}
        What the standard errors allow the residual to be.
    confidence : float
        Of the intervals, for example 0.95.
    """

    regressors: tuple[str, ...] | dict[str, tuple[str, ...]]
    responses: tuple[str, ...] = WRENCH
    frequencies_hz: FrequencyGrid | tuple[float, ...] | None = None
    method: Literal["frequency", "time"] = "frequency"
    form: Literal["force", "specific", "coefficient"] = "force"
    axes: Literal["body", "stability"] = "body"
    trend: Literal["endpoints", "line", "mean", "none"] | None = None
    angular_acceleration: Literal["transform", "record"] = "transform"
    response_source: Literal["reconstruct", "record"] = "reconstruct"
    nuisance: Literal["auto", "constant", "none"] = "auto"
    residuals: Literal["coloured", "white"] = "coloured"
    confidence: float = 0.95

    def __post_init__(self) -> None:
        if not self.responses:
            raise ValueError(f"responses is empty, expected some of {' '.join(WRENCH)}")
        for response in self.responses:
            if response not in WRENCH:
                raise ValueError(f"response '{response}' is unknown; {nearest(response, WRENCH)}")
        if isinstance(self.regressors, dict):
            missing = [r for r in self.responses if r not in self.regressors]
            if missing:
                raise ValueError(f"regressors are missing for response {missing}, expected a list for each")
        for response in self.responses:
            chosen = self.regressors_of(response)
            if not chosen:
                raise ValueError(f"response '{response}' has no regressors, expected at least one")
            twice = sorted({name for name in chosen if chosen.count(name) > 1})
            if twice or "bias" in chosen:
                what = f"names {twice} more than once" if twice else "names 'bias', which is always estimated"
                raise ValueError(f"regressors of '{response}' {what}")
        if not 0.5 <= self.confidence < 1:
            raise ValueError(f"confidence is {self.confidence:g}, expected at least 0.5 and below 1")

    def regressors_of(self, response: str) -> tuple[str, ...]:
        """Return the regressor names of one response."""
        if isinstance(self.regressors, dict):
            return tuple(self.regressors[response])
        return self.regressors


class Gates(Strict, frozen=True):
    """Section ``[gates]``: what a result must reach for a command to end with exit code 0.

    Attributes
    ----------
    r2 : float or dict, optional
        Lowest coefficient of determination, for all responses or by response.
    condition_number : float, optional
        Highest condition number of the scaled regressors.
    """

    r2: float | dict[str, float] | None = None
    condition_number: float | None = None

    def __post_init__(self) -> None:
        asked = self.r2 if isinstance(self.r2, dict) else {}
        for response in asked:
            if response not in WRENCH:
                raise ValueError(f"gate r2 names response '{response}'; {nearest(response, WRENCH)}")
        bars = [*asked.values(), self.condition_number, None if isinstance(self.r2, dict) else self.r2]
        if not all(isfinite(bar) for bar in bars if bar is not None):
            raise ValueError("a gate is not finite, expected a number that can be reached")


class Simulation(Strict, frozen=True):
    """Section ``[simulation]``: what only the simulation knows; its modules validate their parts.

    Attributes
    ----------
    effects : dict
        Settings by effect id.
    airframe, actuators, sensors, wind : dict
    """

    effects: dict[str, Any] = msgspec.field(default_factory=dict)
    airframe: dict[str, Any] = msgspec.field(default_factory=dict)
    actuators: dict[str, Any] = msgspec.field(default_factory=dict)
    sensors: dict[str, Any] = msgspec.field(default_factory=dict)
    wind: dict[str, Any] = msgspec.field(default_factory=dict)


class Scenario(Strict, frozen=True):
    """One aircraft and campaign.

    Attributes
    ----------
    vehicle : Airframe
    effector, rotor, wing, reference : tuple
        One entry for each ``[[effector]]``, ``[[rotor]]``, ``[[wing]]``, ``[[reference]]``.
    excitation : Excitation, optional
    identification : Identification, optional
    control, simulation, tolerance, noise, gates
        The remaining sections; tolerance and noise give one sigma by name.
    """

    vehicle: Airframe
    effector: tuple[Effector, ...] = ()
    rotor: tuple[Rotor, ...] = ()
    wing: tuple[Wing, ...] = ()
    reference: tuple[Reference, ...] = ()
    excitation: Excitation | None = None
    identification: Identification | None = None
    control: dict[str, Any] = msgspec.field(default_factory=dict)
    simulation: Simulation = Simulation()
    tolerance: dict[str, float] = msgspec.field(default_factory=dict)
    noise: dict[str, float] = msgspec.field(default_factory=dict)
    gates: Gates = Gates()

    def __post_init__(self) -> None:
        for at in self.reference:
            if not (isfinite(at.u) and 0 <= at.rho < inf):
                raise ValueError(
                    f"reference '{at.id}' has u = {at.u:g} and rho = {at.rho:g}, expected finite numbers"
                )
        self.aircraft()  # what does not fit together is said when the file is read

    def aircraft(self) -> Vehicle:
        """Return the vehicle that the sections describe together."""
        body = self.vehicle
        return Vehicle(
            name=body.name,
            mass_properties=MassProperties(
                mass_kg=body.mass_kg,
                cg_m=body.cg_m,
                inertia=body.inertia,
                mass_sigma_kg=body.mass_sigma_kg,
                cg_sigma_m=body.cg_sigma_m,
                inertia_sigma=body.inertia_sigma,
            ),
            tilt_rad=body.tilt_rad,
            area_m2=body.area_m2,
            span_m=body.span_m,
            chord_m=body.chord_m,
            effectors=self.effector,
            rotors=self.rotor,
            wings=self.wing,
        )

    def reference_of(self, identifier: str) -> Reference:
        """Return one reference condition.

        Raises
        ------
        UsageError
            Where the scenario has none of that id.
        """
        for reference in self.reference:
            if reference.id == identifier:
                return reference
        raise UsageError(
            f"the scenario has no reference '{identifier}'",
            remedy=nearest(identifier, (r.id for r in self.reference)),
        )


def read_scenario(path: Path) -> tuple[Scenario, str]:
    """Read and validate a scenario file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    scenario : Scenario
    sha256 : str
        Of the file's bytes; results carry it so that they can be traced.

    Raises
    ------
    DataError
        Where the file cannot be read or is no TOML.
    UsageError
        For an unknown key, a wrong type or values that do not fit together, with the key's path.
    """
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise DataError(
            f"cannot be read ({error.strerror})", where=str(path), remedy="check the path"
        ) from None
    try:
        table = tomllib.loads(raw.decode("utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise DataError(f"is no valid TOML ({error})", where=str(path), remedy="mend that line") from None
    return convert(table, Scenario, str(path)), hashlib.sha256(raw).hexdigest()


def convert(table: Any, kind: type[T], where: str) -> T:
    """Convert plain data to a validated struct; an unknown key is an error with its path."""
    try:
        return msgspec.convert(table, kind, strict=True)
    except msgspec.ValidationError as error:
        raise _explained(str(error), kind, where) from None


def overridden(section: S, **changes: Any) -> S:
    """Return a section with some values replaced, those that are not None, and validated again.

    Raises
    ------
    UsageError
        Where the new values do not fit.
    """
    table = msgspec.to_builtins(section) | {k: v for k, v in changes.items() if v is not None}
    return convert(table, type(section), "command line")


def _explained(message: str, kind: type, where: str) -> UsageError:
    """Turn msgspec's sentence into ours, with the nearest known key where a key is unknown."""
    text, _, path = message.partition(" - at `")
    key_path = path.rstrip("`").removeprefix("$").lstrip(".") or "the top level"
    unknown = re.search(r"unknown field `(.+)`", text)
    if unknown:
        return UsageError(
            f"at {key_path}: key '{unknown[1]}' is unknown",
            where=where,
            remedy=nearest(unknown[1], _known_keys(kind, key_path)),
        )
    return UsageError(f"at {key_path}: {text[:1].lower()}{text[1:]}", where=where, remedy="correct the key")


def _known_keys(kind: type, key_path: str) -> list[str]:
    """Return the keys that are allowed at a path of a struct type."""
    if key_path != "the top level":
        for name in re.sub(r"\[[^\]]*\]", "", key_path).split("."):
            hint = next((f.type for f in msgspec.structs.fields(kind) if f.name == name), None)
            nested = _structs_in(hint)
            if not nested:
                return []
            kind = nested[0]
    return [field.name for field in msgspec.structs.fields(kind)]


def _structs_in(hint: Any) -> list[type]:
    """Return the struct types inside a type hint such as ``tuple[Effector, ...]``."""
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return [hint]
    return [found for inner in getattr(hint, "__args__", ()) for found in _structs_in(inner)]

"""A JSBSim aircraft as a simulation: ``jsbsim:c172p``, or an aircraft's XML file.

JSBSim runs along the record: at every sample it is put into the recorded motion, its effectors are where
the record says, and forces and moments are read; engines, which cannot be put anywhere, run on from their
throttle. So that the flight control system does not move the effectors again, its outputs to the recorded
ones are taken out of a working copy of the aircraft.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.gap.connect import answers
from freqid.gap.connect.differences import size
from freqid.gap.connect.flow import RATES, velocity
from freqid.gap.simulation import Settings

Array = NDArray[np.float64]

FOOT, POUND, SLUG = 0.3048, 4.4482216152605, 14.593902937206364
_STEP = 1 / 120  # s, the longest of JSBSim's own steps
_SETTLED = 3.0  # s, after which a flight control system stands still
_ENGINES = 15.0  # s, the same of engines
_GRID_HZ = 10.0  # of derivatives
_CLEARANCE = 1000.0  # m, above ground: manoeuvres are flown high
_FORCES = ("fbx", "fby", "fbz")
_MOMENTS = ("l", "m", "n")
_ALIAS = {"de": "elevator", "da": "aileron", "dr": "rudder", "df": "flap", "dt": "throttle"}
_FELT = ("state/u", "state/v", "state/w", *RATES)


@dataclass(frozen=True, eq=False)
class JsbsimSimulation:
    """A JSBSim aircraft; methods as in `freqid.gap.simulation.Simulation`.

    Effectors of a record are found by name: ``elevator`` (or de) is ``fcs/elevator-pos-rad``, ``aileron``
    the left one and the right one opposite, ``throttle`` is ``fcs/throttle-pos-norm``, any other
    ``fcs/<name>-pos-rad`` or ``-pos-norm``. Commands without a unit are ``fcs/<name>-cmd-norm``; in radians,
    the position that the control system would bring in the end. The moments contain the engines'
    gyroscopic ones, so the vehicle is described without rotors.

    Attributes
    ----------
    aircraft : str
        Name of one of JSBSim's aircraft, or path of an XML file.
    vehicle : Vehicle or None
    """

    aircraft: str
    vehicle: Vehicle | None = None
    name: str = "jsbsim"
    kind: Literal["jsbsim"] = "jsbsim"
    responses: tuple[str, ...] = WRENCH
    effects: Settings = field(default_factory=dict)
    parts: tuple[str, ...] = ()
    _models: dict[tuple[str, ...], Any] = field(default_factory=dict, repr=False)

    def predict(self, record: FlightRecord, effects: Settings | None = None) -> Array:
        """Return the wrench about the centre of gravity, shape (6, sample)."""
        self._has_none(effects)
        rows = [_loads(fdm) for _, fdm in self._along(record)]
        if not np.isfinite(rows).all():
            self._models.clear()  # an engine that is not finite stays so
        return answers.stacked(dict(zip(WRENCH, np.array(rows).T, strict=True)), record.time, self.name)[1]

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return derivatives, shape (6, input, sample): central differences each tenth of a second.

        Engine speeds are held; channels that JSBSim does not feel have zeros.
        """
        motion = self._motion(record)
        steps = {name: size(record[name]) for name in inputs}
        every = max(1, int(1 / (_GRID_HZ * record.dt)))
        grid, found = [], []
        for k, fdm in self._along(record):
            if k % every and k != record.time.size - 1:
                continue
            slopes = np.zeros((len(WRENCH), len(inputs)))
            for i, name in enumerate(inputs):
                pair = []
                for sign in (1, -1):
                    there = motion[:, k].copy()
                    if name in _FELT:
                        there[_FELT.index(name)] += sign * steps[name]
                    _put(fdm, there)
                    if name.startswith("effector/"):
                        _place(fdm, self._where(name.partition("/")[2]), record[name][k] + sign * steps[name])
                    fdm.run_ic()
                    pair.append(_loads(fdm))
                    if name.startswith("effector/"):
                        _place(fdm, self._where(name.partition("/")[2]), record[name][k])
                slopes[:, i] = np.subtract(*pair) / (2 * steps[name])
            _put(fdm, motion[:, k])
            fdm.run_ic()
            grid.append(record.time[k])
            found.append(slopes)
        table = np.array(found)
        return np.array(
            [[np.interp(record.time, grid, table[:, r, i]) for i in range(len(inputs))] for r in range(6)]
        )

    def positions(self, record: FlightRecord, effects: Settings | None = None) -> dict[str, Array]:
        """Return what the flight control system makes of the commands, the motion held still."""
        self._has_none(effects)
        names = [n for n in record.group("command") if self._where(n)]
        if not names:
            return {}
        commands = np.array([self._command(record, n) for n in names])
        fdm, steps = self._ready(record, ())
        for what in (
            "rate/rotational",
            "rate/translational",
            "position/rotational",
            "position/translational",
        ):
            fdm[f"simulation/integrator/{what}"] = 0
        _command(fdm, names, commands[:, 0])
        for _ in range(int(_SETTLED / fdm.get_delta_t())):
            fdm.run()
        out = np.empty_like(commands)
        for k in range(record.time.size):
            for j in range(1, steps + 1) if k else ():
                between = commands[:, k - 1] + (commands[:, k] - commands[:, k - 1]) * j / steps
                _command(fdm, names, between)
                fdm.run()
            out[:, k] = [fdm[self._where(n)[0][0]] for n in names]
        return dict(zip(names, out, strict=True))

    def fly(self, record: FlightRecord, effects: Settings | None = None) -> dict[str, Array]:
        """Return the states of its own flight: from its own trim, by the commands' departures."""
        import jsbsim

        self._has_none(effects)
        names = [n for n in record.group("command") if self._where(n)]
        commands = np.array([self._command(record, n) for n in names]).reshape(len(names), -1)
        fdm, steps = self._ready(record, ())
        start = velocity(record, self._centre(record))[:, 0]
        fdm["ic/vt-fps"], fdm["ic/gamma-deg"] = float(np.linalg.norm(start)) / FOOT, 0.0
        fdm.run_ic()
        try:
            fdm["simulation/do_simple_trim"] = 1
        except jsbsim.TrimFailureError:
            raise DataError(
                f"JSBSim finds no trim at {np.linalg.norm(start):.4g} m/s",
                where=self.name,
                remedy="compare by replay, or begin the record in steady level flight",
            ) from None
        trim = np.array([fdm[f"fcs/{_long(n)}-cmd-norm"] for n in names])
        departure = commands - commands[:, :1] if commands.size else commands
        rows = [_states(fdm)]
        for k in range(1, record.time.size):
            for j in range(1, steps + 1):
                between = departure[:, k - 1] + (departure[:, k] - departure[:, k - 1]) * j / steps
                _command(fdm, names, trim + between)
                fdm.run()
            rows.append(_states(fdm))
            if not np.isfinite(rows[-1]).all() or abs(rows[-1][7]) > 1.4 or rows[-1][-1] < -500:
                raise DataError(
                    f"JSBSim's own flight diverges at t = {record.time[k]:.4g} s",
                    where=self.name,
                    remedy="compare by replay on the flown states",
                )
        return dict(zip(_STATES, np.array(rows).T, strict=True))

    @cached_property
    def _file(self) -> Path:
        import jsbsim

        path = Path(self.aircraft)
        if path.suffix != ".xml":
            path = Path(jsbsim.get_default_root_dir()) / "aircraft" / self.aircraft / f"{self.aircraft}.xml"
        return path

    @cached_property
    def _catalog(self) -> frozenset[str]:
        return frozenset(re.findall(r"fcs/\S+", str(self._model(()).query_property_catalog("fcs/"))))

    def _where(self, name: str) -> list[tuple[str, float]]:
        """Return the properties that an effector is, with their signs; empty where there is none."""
        long = _long(name)
        if long == "aileron":
            pair = [("fcs/left-aileron-pos-rad", 1.0), ("fcs/right-aileron-pos-rad", -1.0)]
            return [(p, sign) for p, sign in pair if p in self._catalog]
        found = [
            f"fcs/{long}-{end}" for end in ("pos-rad", "pos-norm") if f"fcs/{long}-{end}" in self._catalog
        ]
        return [(p, 1.0) for p in found[:1]]

    def _model(self, prescribed: tuple[str, ...]) -> Any:
        """Return JSBSim with the aircraft, whose control system leaves the prescribed properties alone."""
        if prescribed not in self._models:
            self._models[prescribed] = _loaded(self._file, prescribed)
        return self._models[prescribed]

    def _ready(self, record: FlightRecord, prescribed: tuple[str, ...]) -> tuple[Any, int]:
        """Return JSBSim at the record's start with running engines, and its steps for each sample."""
        fdm = self._model(prescribed)
        steps = max(1, int(np.ceil(record.dt / _STEP - 1e-6)))
        fdm.reset_to_initial_conditions(1)
        fdm.set_dt(record.dt / steps)
        for what, how in zip(_INTEGRATORS, (3, 4, 2, 3), strict=True):
            fdm[f"simulation/integrator/{what}"] = how
        motion = self._motion(record)
        fdm["ic/terrain-elevation-ft"] = (float(motion[9].min()) - _CLEARANCE) / FOOT
        _put(fdm, motion[:, 0])
        fdm["fcs/mixture-cmd-norm"] = 1.0
        fdm["propulsion/set-running"] = -1
        fdm.run_ic()
        return fdm, steps

    def _along(self, record: FlightRecord) -> Iterator[tuple[int, Any]]:
        """Yield JSBSim in the motion and with the effectors of every sample."""
        names, prescribed = [], []
        for name in record.group("effector"):
            found = self._where(name)
            if not found:
                raise DataError(
                    f"the aircraft has no effector '{name}'",
                    where=self.name,
                    remedy="name effectors as in fcs/<name>-pos-rad: elevator, aileron, rudder, throttle",
                )
            names.append(name)
            prescribed += [p for p, _ in found]
        motion = self._motion(record)
        fdm, steps = self._ready(record, tuple(prescribed))
        places = record.matrix(f"effector/{n}" for n in names).reshape(len(names), -1)

        def put(k: int) -> None:
            _put(fdm, motion[:, k])
            for name, value in zip(names, places[:, k], strict=True):
                _place(fdm, self._where(name), value)
            fdm.run_ic()

        put(0)
        for _ in range(int(_ENGINES / fdm.get_delta_t())):  # to the speed they start with
            put(0)
            fdm.run()
        for k in range(record.time.size):
            put(k)
            yield k, fdm
            for _ in range(steps):
                fdm.run()

    def _motion(self, record: FlightRecord) -> Array:
        """Return u v w p q r, phi theta psi and the altitude of the record's density, shape (10, sample)."""
        angles = [
            record[f"state/{n}"] if f"state/{n}" in record else 0 * record.time
            for n in ("phi", "theta", "psi")
        ]
        if "air/rho" in record:  # the standard troposphere's altitude for a density
            altitude = (1 - (record["air/rho"] / 1.225) ** (1 / 4.25588)) / 2.25577e-5
        else:
            altitude = record["state/alt"] if "state/alt" in record else np.full(record.time.size, 300.0)
        moving = velocity(record, self._centre(record))
        return np.concatenate([moving, record.matrix(RATES), angles, np.array(altitude)[None]])

    def _centre(self, record: FlightRecord) -> tuple[float, float, float]:
        described = record.vehicle or self.vehicle
        return described.mass_properties.cg_m if described else (0.0, 0.0, 0.0)

    def _command(self, record: FlightRecord, name: str) -> Array:
        """Return a command as JSBSim wants it, from -1 to 1."""
        channel = record.channel(f"command/{name}")
        if channel.unit == "1":
            return channel.values
        norm, position = self._travel(name)
        order = np.argsort(position)
        return np.interp(channel.values, position[order], norm[order])

    def _travel(self, name: str) -> tuple[Array, Array]:
        """Return commands and the positions that they bring in the end."""
        fdm = self._model(())
        where = self._where(name)[0][0]
        low = 0.0 if where.endswith("norm") else -1.0
        norm = np.linspace(low, 1.0, 9)
        found = []
        for value in norm:
            _command(fdm, [name], np.array([value]))
            for _ in range(int(_SETTLED * 120)):
                fdm.run_ic()
            found.append(fdm[where])
        _command(fdm, [name], np.zeros(1))
        return norm, np.array(found)

    def _has_none(self, effects: Settings | None) -> None:
        if effects:
            raise UsageError("a JSBSim aircraft has no effects that could be set", where=self.name)


_INTEGRATORS = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
_STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az", "alt")


def load(aircraft: str, vehicle: Vehicle | None = None) -> JsbsimSimulation:
    """Load an aircraft by its name or its file.

    Raises
    ------
    DataError
        Where JSBSim is not installed, or has or accepts no such aircraft.
    """
    try:
        import jsbsim
    except ImportError:
        raise DataError(
            "JSBSim is not installed", where=f"jsbsim:{aircraft}", remedy="pip install 'freqid[jsbsim]'"
        ) from None
    found = JsbsimSimulation(aircraft, vehicle, name=f"jsbsim:{aircraft}")
    if not found._file.is_file():
        known = Path(jsbsim.get_default_root_dir()) / "aircraft"
        raise DataError(
            f"JSBSim has no aircraft '{aircraft}'",
            where=found.name,
            remedy=f"see {known}, or give an XML file",
        )
    return found if vehicle else JsbsimSimulation(aircraft, _vehicle(found), name=found.name)


def _loaded(file: Path, prescribed: Sequence[str]) -> Any:
    import jsbsim

    root = Path(jsbsim.get_default_root_dir())
    with tempfile.TemporaryDirectory() as folder:
        there = Path(folder) / "aircraft" / file.stem
        there.mkdir(parents=True)
        for part in file.parent.iterdir():
            if part.suffix == ".xml":
                shutil.copy(part, there)
            elif part.is_dir() and part.name.lower() in ("engines", "systems"):
                shutil.copytree(part, there / part.name)
        for copy in there.rglob("*.xml"):
            text = copy.read_text(encoding="utf-8", errors="surrogateescape")
            for where in prescribed:
                text = re.sub(rf"<output>\s*{re.escape(where)}\s*</output>", "", text)
            copy.write_text(text, encoding="utf-8", errors="surrogateescape")
        fdm = jsbsim.FGFDMExec(folder)
        fdm.set_debug_level(0)
        try:
            good = fdm.load_model_with_paths(
                file.stem, str(there.parent), str(root / "engine"), str(root / "systems")
            )
        except Exception as error:
            raise DataError(
                f"JSBSim cannot load it ({error})", where=str(file), remedy="mend the XML"
            ) from None
    if not good:
        raise DataError("JSBSim cannot load it", where=str(file), remedy="mend the XML; JSBSim says where")
    fdm.run_ic()
    return fdm


def _long(name: str) -> str:
    return _ALIAS.get(name, name).replace("_", "-")


def _place(fdm: Any, where: Sequence[tuple[str, float]], value: float) -> None:
    for name, sign in where:
        fdm[name] = sign * float(value)
        if "throttle" in name:  # throttles follow their commands where no component moves them
            fdm[name.replace("-pos-", "-cmd-")] = float(value)


def _command(fdm: Any, names: Sequence[str], values: Array) -> None:
    for name, value in zip(names, values, strict=True):
        fdm[f"fcs/{_long(name)}-cmd-norm"] = float(value)


def _put(fdm: Any, motion: Array) -> None:
    """Set what the next `run_ic` starts from: u v w, m/s, p q r, rad/s, angles, rad, altitude, m."""
    fdm["ic/h-sl-ft"] = float(motion[9]) / FOOT
    for name, value in zip(("phi", "theta", "psi-true"), motion[6:9], strict=True):
        fdm[f"ic/{name}-rad"] = float(value)
    for name, value in zip("uvw", motion[:3], strict=True):
        fdm[f"ic/{name}-fps"] = float(value) / FOOT
    for name, value in zip("pqr", motion[3:6], strict=True):
        fdm[f"ic/{name}-rad_sec"] = float(value)


def _loads(fdm: Any) -> list[float]:
    """Return aerodynamic and propulsive X Y Z L M N, N and N m."""
    forces = [POUND * (fdm[f"forces/{n}-aero-lbs"] + fdm[f"forces/{n}-prop-lbs"]) for n in _FORCES]
    size = POUND * FOOT
    return forces + [
        size * (fdm[f"moments/{n}-aero-lbsft"] + fdm[f"moments/{n}-prop-lbsft"]) for n in _MOMENTS
    ]


def _states(fdm: Any) -> list[float]:
    """Return the states in the order of `_STATES`, specific force of the centre of gravity among them."""
    felt = np.array(_loads(fdm)[:3]) / (SLUG * fdm["inertia/mass-slugs"])
    moving = [FOOT * fdm[f"velocities/{n}-fps"] for n in "uvw"]
    turning = [fdm[f"velocities/{n}-rad_sec"] for n in "pqr"]
    angles = [fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")]
    return [*moving, *turning, *angles, *felt, FOOT * fdm["position/h-sl-ft"]]


def _vehicle(simulation: JsbsimSimulation) -> Vehicle:
    """Return the vehicle as JSBSim has it, its centre of gravity as the origin."""
    fdm = simulation._model(())
    unit = SLUG * FOOT**2
    inertia = {n: unit * fdm[f"inertia/i{n}-slugs_ft2"] for n in ("xx", "yy", "zz", "xy", "yz")}
    inertia["xz"] = -unit * fdm["inertia/ixz-slugs_ft2"]  # JSBSim's x points aft, its z up
    effectors = []
    for name in ("elevator", "aileron", "rudder", "throttle"):
        if simulation._where(name):
            travel = simulation._travel(name)[1]
            kind = "throttle" if name == "throttle" else "surface"
            if np.ptp(travel) > 0:
                effectors.append(
                    Effector(name=name, kind=kind, limits=(float(travel.min()), float(travel.max())))
                )
    return Vehicle(
        name=simulation.aircraft,
        mass_properties=MassProperties(mass_kg=SLUG * fdm["inertia/mass-slugs"], inertia=Inertia(**inertia)),
        area_m2=FOOT**2 * fdm["metrics/Sw-sqft"],
        span_m=FOOT * fdm["metrics/bw-ft"],
        chord_m=FOOT * fdm["metrics/cbarw-ft"],
        effectors=tuple(effectors),
    )

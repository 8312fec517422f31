"""An aircraft as JSBSim has it: file, effectors and their travel, masses, and its properties in SI units."""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Generator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.units import FOOT, POUND_FORCE
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle

SETTLED = 3.0  # s, after which a flight control system stands still
SLUG = POUND_FORCE / FOOT  # kg
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az", "alt")
_FORCES = ("fbx", "fby", "fbz")
_MOMENTS = ("l", "m", "n")
_ALIAS = {"de": "elevator", "da": "aileron", "dr": "rudder", "df": "flap", "dt": "throttle"}


@contextmanager
def quiet() -> Generator[Any]:
    """Keep what JSBSim writes from C++ to stdout and stderr away from both; yield the file that gets it."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [os.dup(number) for number in (1, 2)]
    with tempfile.TemporaryFile() as written:
        try:
            for number in (1, 2):
                os.dup2(written.fileno(), number)
            with redirect_stdout(StringIO()):  # its banner goes to Python's, which may be no file
                yield written
        finally:
            if os.name == "posix":
                ctypes.CDLL(None).fflush(None)  # C++ holds back what does not go to a terminal
            for number, old in zip((1, 2), saved, strict=True):
                os.dup2(old, number)
                os.close(old)


@dataclass(frozen=True, eq=False)
class JsbsimAircraft:
    """One aircraft, and JSBSim loaded with it.

    Attributes
    ----------
    given : str
        Name of one of JSBSim's aircraft, or path of an XML file.
    """

    given: str
    _models: dict[tuple[str, ...], Any] = field(default_factory=dict, repr=False)
    _places: dict[str, list[tuple[str, float]]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, given: str) -> JsbsimAircraft:
        """Return an aircraft that is there.

        Raises
        ------
        DataError
            Where JSBSim is not installed, or has no such aircraft.
        """
        aircraft = cls(given)
        try:
            import jsbsim
        except ImportError:
            raise DataError(
                "JSBSim is not installed", where=aircraft.name, remedy="pip install 'freqid[jsbsim]'"
            ) from None
        if not aircraft.file.is_file():
            known = Path(jsbsim.get_default_root_dir()) / "aircraft"
            raise DataError(
                f"JSBSim has no aircraft '{given}'",
                where=aircraft.name,
                remedy=f"see {known}, or give an XML file",
            )
        return aircraft

    @property
    def name(self) -> str:
        """As on the command line."""
        return f"jsbsim:{self.given}"

    @cached_property
    def file(self) -> Path:
        """The aircraft's own XML file."""
        import jsbsim

        path = Path(self.given)
        if path.suffix != ".xml":
            path = Path(jsbsim.get_default_root_dir()) / "aircraft" / self.given / f"{self.given}.xml"
        return path

    @cached_property
    def _catalog(self) -> frozenset[str]:
        with quiet():
            listed = str(self.model(()).query_property_catalog("fcs/"))
        return frozenset(re.findall(r"fcs/[^\s'\",]+", listed))

    def where(self, name: str) -> list[tuple[str, float]]:
        """Return the properties that an effector is, with their signs; empty where there is none."""
        if name not in self._places:  # looked for in hundreds of names, and asked at every step
            self._places[name] = self._found(name)
        return self._places[name]

    def _found(self, name: str) -> list[tuple[str, float]]:
        long = effector_name(name)
        if long == "aileron":
            pair = [("fcs/left-aileron-pos-rad", 1.0), ("fcs/right-aileron-pos-rad", -1.0)]
            return [(p, sign) for p, sign in pair if p in self._catalog]
        engine = re.fullmatch(r"throttle-?(\d+)", long)  # counted from one
        if engine or long == "throttle":
            every = self._engines("throttle-pos-norm")
            return [(p, 1.0) for k, p in enumerate(every, 1) if not engine or k == int(engine[1])]
        positions = [f"fcs/{long}-{end}" for end in ("pos-rad", "pos-norm")]
        return [(p, 1.0) for p in positions if p in self._catalog][:1]

    def _engines(self, name: str) -> list[str]:
        """Return a property of each engine, the first engine first."""
        listed = [p for p in self._catalog if re.fullmatch(rf"fcs/{name}(\[\d+\])?", p)]
        return sorted(listed, key=lambda p: int(p.rpartition("[")[2].rstrip("]")) if "[" in p else 0)

    def commands(self, name: str) -> list[str]:
        """Return the properties that command an effector; those of all engines for ``throttle``."""
        long = effector_name(name)
        if long.startswith("throttle"):
            return [_command_of(p) for p, _ in self.where(name)]
        return [f"fcs/{long}-cmd-norm"]

    def command(self, fdm: Any, names: Sequence[str], values: Array) -> None:
        """Set commands of effectors, from -1 to 1."""
        for name, value in zip(names, values, strict=True):
            for where in self.commands(name):
                fdm[where] = float(value)

    def start_engines(self, fdm: Any) -> None:
        """Let all engines run, with a rich mixture, from the next `run_ic` on."""
        for where in self._engines("mixture-cmd-norm") or ["fcs/mixture-cmd-norm"]:
            fdm[where] = 1.0
        fdm["propulsion/set-running"] = -1

    def model(self, prescribed: tuple[str, ...]) -> Any:
        """Return JSBSim with the aircraft, whose control system leaves the prescribed properties alone."""
        if prescribed not in self._models:
            self._models[prescribed] = _loaded(self.file, prescribed)
        return self._models[prescribed]

    @quiet()
    def travel(self, name: str) -> tuple[Array, Array]:
        """Return commands and the positions that they bring in the end."""
        fdm = self.model(())
        where = self.where(name)[0][0]
        low = 0.0 if where.endswith("norm") else -1.0
        norm = np.linspace(low, 1.0, 9)
        position = []
        for value in norm:
            self.command(fdm, [name], np.array([value]))
            for _ in range(int(SETTLED * 120)):
                fdm.run_ic()
            position.append(fdm[where])
        self.command(fdm, [name], np.zeros(1))
        return norm, np.array(position)

    def forget(self) -> None:
        """Load anew from now on: an engine that is not finite stays so."""
        self._models.clear()

    def vehicle(self) -> Vehicle:
        """Return the vehicle as JSBSim has it, its centre of gravity as the origin."""
        fdm = self.model(())
        unit = SLUG * FOOT**2
        inertia = {n: unit * fdm[f"inertia/i{n}-slugs_ft2"] for n in ("xx", "yy", "zz", "xy", "yz")}
        inertia["xz"] = -unit * fdm["inertia/ixz-slugs_ft2"]  # JSBSim's x points aft, its z up
        effectors = []
        for name in ("elevator", "aileron", "rudder", "throttle"):
            if self.where(name):
                travel = self.travel(name)[1]
                kind = "throttle" if name == "throttle" else "surface"
                if np.ptp(travel) > 0:
                    effectors.append(
                        Effector(name=name, kind=kind, limits=(float(travel.min()), float(travel.max())))
                    )
        return Vehicle(
            name=self.given,
            mass_properties=MassProperties(
                mass_kg=SLUG * fdm["inertia/mass-slugs"], inertia=Inertia(**inertia)
            ),
            area_m2=FOOT**2 * fdm["metrics/Sw-sqft"],
            span_m=FOOT * fdm["metrics/bw-ft"],
            chord_m=FOOT * fdm["metrics/cbarw-ft"],
            effectors=tuple(effectors),
        )


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
        with quiet() as written:
            fdm = jsbsim.FGFDMExec(folder)
            fdm.set_debug_level(0)
            try:
                good = fdm.load_model_with_paths(
                    file.stem, str(there.parent), str(root / "engine"), str(root / "systems")
                )
                reason = "" if good else _last_line(written)
            except Exception as error:
                good, reason = False, " ".join(str(error).split())
            if good:
                fdm.run_ic()
    if not good:
        raise DataError(f"JSBSim cannot load it ({reason})", where=str(file), remedy="mend the XML")
    return fdm


def _last_line(written: Any) -> str:
    written.seek(0)
    text = re.sub(r"\x1b\[[\d;]*m", "", written.read().decode(errors="replace"))
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "no reason given")


def effector_name(name: str) -> str:
    """Return what JSBSim calls an effector, ``elevator`` for ``de``."""
    return _ALIAS.get(name, name).replace("_", "-")


def place(fdm: Any, where: Sequence[tuple[str, float]], value: float) -> None:
    """Set the properties that an effector is, with their signs."""
    for name, sign in where:
        fdm[name] = sign * float(value)
        if "throttle" in name:  # throttles follow their commands where no component moves them
            fdm[_command_of(name)] = float(value)


def _command_of(position: str) -> str:
    return position.replace("-pos-", "-cmd-")


def put(fdm: Any, motion: Array) -> None:
    """Set what the next `run_ic` starts from: u v w, m/s, p q r, rad/s, angles, rad, altitude, m."""
    fdm["ic/h-sl-ft"] = float(motion[9]) / FOOT
    for name, value in zip(("phi", "theta", "psi-true"), motion[6:9], strict=True):
        fdm[f"ic/{name}-rad"] = float(value)
    for name, value in zip("uvw", motion[:3], strict=True):
        fdm[f"ic/{name}-fps"] = float(value) / FOOT
    for name, value in zip("pqr", motion[3:6], strict=True):
        fdm[f"ic/{name}-rad_sec"] = float(value)


def loads(fdm: Any) -> list[float]:
    """Return aerodynamic and propulsive X Y Z L M N, N and N m."""
    forces = [POUND_FORCE * (fdm[f"forces/{n}-aero-lbs"] + fdm[f"forces/{n}-prop-lbs"]) for n in _FORCES]
    size = POUND_FORCE * FOOT
    return forces + [
        size * (fdm[f"moments/{n}-aero-lbsft"] + fdm[f"moments/{n}-prop-lbsft"]) for n in _MOMENTS
    ]


def states(fdm: Any) -> list[float]:
    """Return the states in the order of `STATES`, specific force of the centre of gravity among them."""
    felt = np.array(loads(fdm)[:3]) / (SLUG * fdm["inertia/mass-slugs"])
    moving = [FOOT * fdm[f"velocities/{n}-fps"] for n in "uvw"]
    turning = [fdm[f"velocities/{n}-rad_sec"] for n in "pqr"]
    angles = [fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")]
    return [*moving, *turning, *angles, *felt, FOOT * fdm["position/h-sl-ft"]]

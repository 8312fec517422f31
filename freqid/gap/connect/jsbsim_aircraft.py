"""An aircraft as JSBSim has it: its file, what its effectors are called and how far they go, its masses."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.gap.connect.jsbsim_properties import FOOT, SLUG, command, effector_name

Array = NDArray[np.float64]

SETTLED = 3.0  # s, after which a flight control system stands still


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

    @classmethod
    def of(cls, given: str) -> JsbsimAircraft:
        """Return an aircraft that is there.

        Raises
        ------
        DataError
            Where JSBSim is not installed, or has no such aircraft.
        """
        found = cls(given)
        try:
            import jsbsim
        except ImportError:
            raise DataError(
                "JSBSim is not installed", where=found.name, remedy="pip install 'freqid[jsbsim]'"
            ) from None
        if not found.file.is_file():
            known = Path(jsbsim.get_default_root_dir()) / "aircraft"
            raise DataError(
                f"JSBSim has no aircraft '{given}'",
                where=found.name,
                remedy=f"see {known}, or give an XML file",
            )
        return found

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
        return frozenset(re.findall(r"fcs/\S+", str(self.model(()).query_property_catalog("fcs/"))))

    def where(self, name: str) -> list[tuple[str, float]]:
        """Return the properties that an effector is, with their signs; empty where there is none."""
        long = effector_name(name)
        if long == "aileron":
            pair = [("fcs/left-aileron-pos-rad", 1.0), ("fcs/right-aileron-pos-rad", -1.0)]
            return [(p, sign) for p, sign in pair if p in self._catalog]
        found = [
            f"fcs/{long}-{end}" for end in ("pos-rad", "pos-norm") if f"fcs/{long}-{end}" in self._catalog
        ]
        return [(p, 1.0) for p in found[:1]]

    def model(self, prescribed: tuple[str, ...]) -> Any:
        """Return JSBSim with the aircraft, whose control system leaves the prescribed properties alone."""
        if prescribed not in self._models:
            self._models[prescribed] = _loaded(self.file, prescribed)
        return self._models[prescribed]

    def travel(self, name: str) -> tuple[Array, Array]:
        """Return commands and the positions that they bring in the end."""
        fdm = self.model(())
        where = self.where(name)[0][0]
        low = 0.0 if where.endswith("norm") else -1.0
        norm = np.linspace(low, 1.0, 9)
        found = []
        for value in norm:
            command(fdm, [name], np.array([value]))
            for _ in range(int(SETTLED * 120)):
                fdm.run_ic()
            found.append(fdm[where])
        command(fdm, [name], np.zeros(1))
        return norm, np.array(found)

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

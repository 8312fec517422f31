"""JSBSim's c172p as a description that can be edited."""

from __future__ import annotations

import copy
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from gap_c172p import CONTROLS

RATE_HZ, STEPS = 25.0, 8
_SCALES = {"elevator": ("elevator",), "aileron": ("left-aileron", "right-aileron"), "rudder": ("rudder",)}
_SUMS = {"elevator": "fcs/pitch-trim-sum", "aileron": "fcs/roll-trim-sum", "rudder": "fcs/yaw-trim-sum"}
SURFACES = tuple(_SCALES)
TRAVEL = {"elevator": 0.445, "aileron": 0.305, "rudder": 0.279}  # rad for each unit of command, in the mean

Array = np.ndarray


@dataclass(frozen=True)
class Weighed:
    """What a loaded aircraft weighs: lb, in, slug ft2."""

    weight: float
    empty: float
    place: tuple[float, ...]
    inertia: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Craft:
    """One aircraft: its XML, that of its propeller, what rises, and what is logged.

    Attributes
    ----------
    root, propeller : Element
    rising : dict of float
        Properties, the wind for one, that come up after the trim and before the record.
    logged : dict of str
        Property that is logged as an effector's position, by its name.
    accelerometer : ndarray, shape (3,)
        Where it is beside the nominal centre of gravity, body axes, m.
    ground : list
        Not empty where velocities over the ground are logged.
    """

    root: ET.Element
    propeller: ET.Element
    rising: dict[str, float] = field(default_factory=dict)
    logged: dict[str, str] = field(default_factory=lambda: dict(CONTROLS))
    accelerometer: Array = field(default_factory=lambda: np.zeros(3))
    ground: list[bool] = field(default_factory=list)

    @classmethod
    def nominal(cls) -> Craft:
        """Return the c172p of the installed JSBSim."""
        root, propeller = _sources()
        return cls(copy.deepcopy(root), copy.deepcopy(propeller))

    def function(self, name: str) -> ET.Element:
        """Return one aerodynamic coefficient."""
        return next(f for f in self.root.iter("function") if f.get("name") == f"aero/coefficient/{name}")

    @property
    def coefficients(self) -> list[str]:
        """Names of all aerodynamic coefficients."""
        names = (f.get("name", "") for f in self.root.iter("function"))
        return [n.rpartition("/")[2] for n in names if n.startswith("aero/coefficient/")]

    def times(self, name: str, factor: float) -> None:
        """Multiply a coefficient."""
        product = self.function(name).find("product")
        assert product is not None
        ET.SubElement(product, "value").text = repr(float(factor))

    def part(self, axis: str, xml: str) -> None:
        """Add a function to an axis, DRAG SIDE LIFT ROLL PITCH YAW."""
        found = next(a for a in self.root.iter("axis") if a.get("name") == axis)
        found.append(ET.fromstring(f"<function>{xml}</function>"))

    def before(self, control: str, xml: str) -> None:
        """Put a component between a command and its actuator: ``{0}`` is its name and input."""
        if control == "throttle":
            text = xml.format('name="fcs/changed-throttle"', "<input>fcs/throttle-cmd-norm</input>")
            component = ET.fromstring(text)
            ET.SubElement(component, "output").text = CONTROLS["throttle"]
            self.channel(component)
            return
        for channel in self.root.iter("channel"):
            for scale in channel:
                given = scale.find("input")
                if scale.tag != "summer" and given is not None and _text(given) == _SUMS[control]:
                    given.text = f"fcs/changed-{control}"
        for channel in self.root.iter("channel"):
            for at, summer in enumerate(list(channel)):
                name = (summer.get("name") or "").lower().replace(" ", "-")
                if summer.tag == "summer" and f"fcs/{name}" == _SUMS[control]:
                    text = xml.format(f'name="fcs/changed-{control}"', f"<input>{_SUMS[control]}</input>")
                    channel.insert(at + 1, ET.fromstring(text))

    def behind(self, control: str, xml: str) -> None:
        """Put a component between a logged position and what the airframe feels."""
        if control == "throttle":
            given = "<input>fcs/throttle-cmd-norm</input><gain>1</gain>"
            servo = f'<pure_gain name="fcs/servo-throttle">{given}</pure_gain>'
            text = xml.format('name="fcs/changed-throttle"', "<input>fcs/servo-throttle</input>")
            component = ET.fromstring(text)
            ET.SubElement(component, "output").text = CONTROLS["throttle"]
            self.channel(ET.fromstring(servo), component)
            self.logged["throttle"] = "fcs/servo-throttle"
            return
        for side in _SCALES[control]:
            for channel in self.root.iter("channel"):
                for at, scale in enumerate(list(channel)):
                    out = scale.find("output")
                    if out is not None and _text(out) == f"fcs/{side}-pos-rad":
                        out.text = f"fcs/{side}-servo-rad"
                        text = xml.format(
                            f'name="fcs/changed-{side}"', f"<input>fcs/{side}-servo-rad</input>"
                        )
                        component = ET.fromstring(text)
                        ET.SubElement(component, "output").text = f"fcs/{side}-pos-rad"
                        channel.insert(at + 1, component)
        self.logged[control] = f"fcs/{_SCALES[control][0]}-servo-rad"

    def channel(self, *components: ET.Element) -> None:
        """Add a channel to the flight control system."""
        fcs = self.root.find("flight_control")
        assert fcs is not None
        added = ET.SubElement(fcs, "channel", {"name": f"Added {len(fcs)}"})
        added.extend(components)

    def switch(self) -> str:
        """Return a property that is zero in the trim, whose search no memory may see, and one in flight."""
        fcs = self.root.find("flight_control")
        assert fcs is not None
        added = ET.Element("property", {"value": "0"})
        added.text = "fcs/in-flight"
        fcs.insert(0, added)
        self.rising["fcs/in-flight"] = 1.0
        return "fcs/in-flight"

    def weighed(self) -> Weighed:
        """Return what the unedited aircraft weighs."""
        return _weighed()

    def ballast(self, pounds: float) -> None:
        """Put a weight at the nominal centre of gravity."""
        balance = self.root.find("mass_balance")
        assert balance is not None
        x, y, z = self.weighed().place
        text = f'<pointmass name="Ballast"><weight unit="LBS">{float(pounds)!r}</weight><location unit="IN">'
        balance.append(ET.fromstring(f"{text}<x>{x!r}</x><y>{y!r}</y><z>{z!r}</z></location></pointmass>"))

    def shift(self, metres: Iterable[float]) -> None:
        """Move the centre of gravity, m, body axes, by moving that of the empty aircraft."""
        place = next(p for p in self.root.iter("location") if p.get("name") == "CG")
        w = self.weighed()
        for axis, sign, metre in zip("xyz", (-1, 1, -1), metres, strict=True):
            item = place.find(axis)
            assert item is not None
            item.text = repr(float(_text(item)) + float(sign * metre) / 0.0254 * w.weight / w.empty)

    def turn_harder(self, shares: Mapping[str, float]) -> None:
        """Add shares of the whole moments of inertia, by axis ``xx yy zz``."""
        balance = self.root.find("mass_balance")
        assert balance is not None
        for axis, whole in zip(("xx", "yy", "zz"), self.weighed().inertia, strict=True):
            item = balance.find(f"i{axis}")
            assert item is not None
            item.text = repr(float(_text(item)) + float(shares.get(axis, 0.0)) * whole)

    def loaded(self) -> Any:
        """Return JSBSim with the aircraft."""
        import jsbsim

        home = Path(jsbsim.get_default_root_dir())
        with tempfile.TemporaryDirectory() as folder:
            there = Path(folder) / "aircraft" / "c172p"
            (there / "Engines").mkdir(parents=True)
            (there / "c172p.xml").write_bytes(ET.tostring(self.root))
            (there / "Engines" / "prop_75in2f.xml").write_bytes(ET.tostring(self.propeller))
            fdm = jsbsim.FGFDMExec(folder)
            fdm.set_debug_level(0)
            fdm.set_dt(1 / (STEPS * RATE_HZ))
            fdm.load_model_with_paths("c172p", str(there.parent), str(home / "engine"), str(home / "systems"))
        return fdm


def _text(element: ET.Element) -> str:
    return (element.text or "").strip()


@lru_cache(maxsize=1)
def _sources() -> tuple[ET.Element, ET.Element]:
    import jsbsim

    home = Path(jsbsim.get_default_root_dir())
    text = (home / "aircraft" / "c172p" / "c172p.xml").read_bytes().decode("latin-1")
    root = ET.fromstring(text)
    for output in root.findall("output"):
        root.remove(output)
    return root, ET.parse(home / "engine" / "prop_75in2f.xml").getroot()


@lru_cache(maxsize=1)
def _weighed() -> Weighed:
    fdm = Craft.nominal().loaded()
    fdm.run_ic()
    return Weighed(
        fdm["inertia/weight-lbs"],
        fdm["inertia/empty-weight-lbs"],
        tuple(fdm[f"inertia/cg-{n}-in"] for n in "xyz"),
        tuple(fdm[f"inertia/i{n}-slugs_ft2"] for n in ("xx", "yy", "zz")),
    )

"""JSBSim's c172p as a description that can be edited, and its flights: what `c172p_cases` is flown with."""

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
from gap_c172p import AMPLITUDE, CONTROLS, FOOT, INTEGRATORS, SLUG

RATE_HZ, STEPS, ALTITUDE = 25.0, 8, 3000.0  # ft
_TERRAIN = 2200.0  # ft: gusts are those of 800 ft above ground
_RISE = 30.0  # s, that a wind has to come up before the record
_LAID_OUT = {n: 2.0 * a for n, a in AMPLITUDE.items()}  # of full travel, peak
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


def excitation(time: Array, seed: int) -> Array:
    """Return multisines of full travel over the whole record, shape (control, sample)."""
    rng = np.random.default_rng(seed)
    span = time[-1] + time[1]
    found = []
    for i, name in enumerate(CONTROLS):
        k = np.arange(3 + i, round(1.9 * span) + 1, len(CONTROLS))
        turns = 2 * np.pi * np.outer(time / span, k)
        tries = (np.sin(turns + rng.uniform(0, 2 * np.pi, k.size)).sum(axis=1) for _ in range(30))
        best = min(tries, key=np.ptp)
        found.append(_LAID_OUT[name] * best / np.abs(best).max())
    return np.array(found)


def fly(craft: Craft, speed: float, signals: Array, *, gusts: float, seed: int) -> dict[str, Array]:
    """Return channels of a flight from trim, SI, logged at the nominal centre of gravity.

    Parameters
    ----------
    craft : Craft
    speed : float
        m/s.
    signals : ndarray, shape (control, sample)
        Of full travel; a light attitude hold is added.
    gusts : float
        Mean wind at 20 ft that JSBSim's Dryden turbulence goes with, m/s.
    seed : int
        Of the gusts.

    Raises
    ------
    ArithmeticError
        Where the flight diverges or there is no trim.
    """
    import jsbsim

    fdm = craft.loaded()
    given = {
        "h-sl-ft": ALTITUDE,
        "terrain-elevation-ft": _TERRAIN,
        "vt-fps": speed / FOOT,
        "psi-true-deg": 90.0,
    }
    for name, value in (given | {"gamma-deg": 0.0}).items():
        fdm[f"ic/{name}"] = value
    fdm["fcs/mixture-cmd-norm"] = 1.0
    fdm["propulsion/set-running"] = -1
    for what, how in INTEGRATORS.items():
        fdm[f"simulation/integrator/{what}"] = how
    fdm.run_ic()
    try:
        fdm["simulation/do_simple_trim"] = 1
    except jsbsim.TrimFailureError:
        raise ArithmeticError(f"no trim at {speed:g} m/s") from None
    if gusts:
        fdm["simulation/randomseed"] = seed
        fdm["atmosphere/randomseed"] = seed
        fdm["atmosphere/turb-type"] = 3
        fdm["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = gusts / FOOT
        fdm["atmosphere/turbulence/milspec/severity"] = 3
    trim = np.array([fdm[f"fcs/{n}-cmd-norm"] for n in CONTROLS])
    trim[0] += fdm["fcs/pitch-trim-cmd-norm"]
    fdm["fcs/pitch-trim-cmd-norm"] = 0.0
    level, bank, before, rows = fdm["attitude/theta-rad"], fdm["attitude/phi-rad"], trim, []

    def held(command: Array) -> Array:
        """Return commands with a light hold of the attitude."""
        pitch = 0.6 * (fdm["attitude/theta-rad"] - level) + 0.2 * fdm["velocities/q-rad_sec"]
        roll = -0.5 * (fdm["attitude/phi-rad"] - bank) - 0.1 * fdm["velocities/p-rad_sec"]
        return command + np.array([pitch, roll, 0.0, 0.0])

    def step(now: Array) -> None:
        for share in np.arange(1, STEPS + 1) / STEPS:
            for name, value in zip(CONTROLS, before + share * (now - before), strict=True):
                fdm[f"fcs/{name}-cmd-norm"] = float(value)
            fdm.run()

    for k in range(round(_RISE * RATE_HZ) if craft.rising else 0):
        for name, value in craft.rising.items():
            fdm[name] = value * min(1.0, 2 * k / (_RISE * RATE_HZ))
        now = held(trim)
        step(now)
        before = now
    for k in range(signals.shape[1]):
        now = held(trim + signals[:, k]) if k else before
        if k:
            step(now)
        rows.append(_seen(fdm, craft, now, signals[:, k]))
        before = now
    found = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    if not all(np.isfinite(x).all() for x in found.values()) or np.abs(found["state/phi"]).max() > 1.0:
        raise ArithmeticError(f"the flight at {speed:g} m/s diverges")
    return found


def _seen(fdm: Any, craft: Craft, command: Array, injected: Array) -> dict[str, float]:
    """Return one row of the log."""
    rates = np.array([fdm[f"velocities/{n}-rad_sec"] for n in "pqr"])
    turning = np.array([fdm[f"accelerations/{n}dot-rad_sec2"] for n in "pqr"])
    place = np.array([fdm[f"inertia/cg-{n}-in"] for n in "xyz"])
    arm = 0.0254 * (np.array(craft.weighed().place) - place) * (-1, 1, -1)  # from the true centre of gravity
    felt = np.array([fdm[f"forces/fb{n}-aero-lbs"] + fdm[f"forces/fb{n}-prop-lbs"] for n in "xyz"])
    felt = FOOT * felt / fdm["inertia/mass-slugs"]
    out = arm + craft.accelerometer
    felt = felt + np.cross(turning, out) + np.cross(rates, np.cross(rates, out))
    kind = "" if craft.ground else "-aero"
    moving = FOOT * np.array([fdm[f"velocities/{n}{kind}-fps"] for n in "uvw"]) + np.cross(rates, arm)
    row = dict(zip(("state/u", "state/v", "state/w"), moving.tolist(), strict=True))
    row |= dict(zip(("state/p", "state/q", "state/r"), rates.tolist(), strict=True))
    row |= {f"state/{n}": fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")}
    row |= dict(zip(("state/ax", "state/ay", "state/az"), felt.tolist(), strict=True))
    row["state/alt"] = FOOT * fdm["position/h-sl-ft"]
    row["air/rho"] = SLUG / FOOT**3 * fdm["atmosphere/rho-slugs_ft3"]
    for name, sent, added in zip(CONTROLS, command, injected, strict=True):
        row[f"effector/{name}"] = fdm[craft.logged[name]]
        row[f"command/{name}"], row[f"excitation/{name}"] = float(sent), float(added)
    return row

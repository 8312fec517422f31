"""JSBSim's c172p as simulation, an edited copy of it as aircraft: three flights compared, one held out."""

from __future__ import annotations

import re
import shutil
import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import gap_c172p as base
import numpy as np
from scatter import MASS, Settings, added, drawn, drawn_for_a_flight

from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.gap.connect import connect
from freqid.gap.model.tolerance import DERIVATIVES, UNDECLARED
from freqid.gap.simulation import Simulation
from freqid.simulate.effects import distorted, library

SIMULATION, SCENARIO_FILE = "jsbsim:c172p", None
BAND_HZ = base.BAND_HZ
INCH = 0.0254
SURFACES = {  # functions of the file that go with a surface's deflection
    "elevator": ("CDDe", "CLDe", "Cmde"),
    "aileron": ("CYda", "ClDa", "Cnda"),
    "rudder": ("CYdr", "Cldr", "Cndr"),
}
CONTROL = {  # scale of a surface, and the property that it takes
    "elevator": ("Elevator Control", "fcs/pitch-trim-sum"),
    "rudder": ("Rudder Control", "fcs/yaw-trim-sum"),
}
PLACES = (  # effect, parameter, sign
    ("surface_effectiveness", "elevator", 1),
    ("actuator_delay", "elevator", 1),
    ("cg_offset", "x", 1),
    ("time_skew", "rates", 1),
    ("mass", "fraction", 1),
    ("surface_effectiveness", "rudder", 1),
    ("sensor_scale", "q", 1),
    ("inertia", "yy", 1),
    ("surface_effectiveness", "aileron", 1),
    ("flow_upwash", "alpha", 1),
    ("misalignment", "imu_y", 1),
    ("inertia", "zz", 1),
)


@lru_cache
def simulation() -> Simulation:
    """Return what the diagnosis has."""
    return connect(SIMULATION)


def flown(effect: Settings, seed: int) -> list[FlightRecord]:
    """Return the records of one case; every coefficient, mass and sensors are scattered."""
    rng = np.random.default_rng([seed, 172])
    vehicle = simulation().vehicle
    assert vehicle is not None
    settings = added(effect, drawn(library(), vehicle, 1 / base.RATE_HZ / np.sqrt(12), rng))
    found = []
    with tempfile.TemporaryDirectory() as there:
        folder = edited(Path(there), settings, vehicle, rng)
        for k, speed in enumerate((*base.SPEEDS, base.HELD_OUT)):
            record = replace(base.fly(folder, speed, 10 * seed + k), vehicle=vehicle)
            logged = added({i: s for i, s in settings.items() if i not in MASS}, drawn_for_a_flight(rng))
            found.append(replace(distorted(record, logged), vehicle=None))
    return found


def edited(folder: Path, settings: Settings, vehicle: Vehicle, rng: np.random.Generator) -> Path:
    """Copy the aircraft, edit its file, and return the folder of aircraft.

    Each aerodynamic function gets a factor: as far off as a derivative may be, and less what a surface loses.
    """
    import jsbsim

    source = Path(jsbsim.get_default_root_dir()) / "aircraft" / "c172p"
    there = folder / "aircraft" / "c172p"
    shutil.copytree(source, there)
    file = there / "c172p.xml"
    text = file.read_text(encoding="utf-8", errors="surrogateescape")
    lost = settings.get("surface_effectiveness", {})
    of = {name: surface for surface, names in SURFACES.items() for name in names}

    def scaled(found: re.Match[str]) -> str:
        factor = 1 + UNDECLARED[DERIVATIVES] * rng.standard_normal()
        factor *= 1 - lost.get(of.get(found[2], ""), 0.0)
        return f"{found[1]}<value>{factor:.8f}</value>"

    one = r'(<function name="aero/coefficient/(\w+)">(?:(?!</function>).)*?<product>)'
    text = re.sub(one, scaled, text, flags=re.DOTALL)
    text = _weighed(text, settings, vehicle)
    for surface, late in settings.get("actuator_delay", {}).items():
        label, source_name = CONTROL[surface]
        told = late + 1.001 / (base.STEPS * base.RATE_HZ)  # actuators wait one step less than they are told
        part = f'<actuator name="fcs/late-{surface}"><input>{source_name}</input>'
        part += f'<delay type="time">{told}</delay></actuator>'
        old = rf'(<aerosurface_scale name="{label}">\s*<input>){source_name}(</input>)'
        text, count = re.subn(old, rf"{part}\n\1fcs/late-{surface}\2", text, count=1)
        assert count == 1
    file.write_text(text, encoding="utf-8", errors="surrogateescape")
    return there.parent


def _weighed(text: str, settings: Settings, vehicle: Vehicle) -> str:
    """Return the file with another mass, centre of gravity and inertia: those of the empty airplane."""
    mass, offset, inertia = (settings.get(i, {}) for i in MASS)

    def moved(text: str, pattern: str, by: float) -> str:
        text, count = re.subn(
            pattern, lambda m: f"{m[1]} {float(m[2]) + by:.8f} {m[3]}", text, count=1, flags=re.DOTALL
        )
        assert count == 1, pattern
        return text

    total = vehicle.mass_properties.mass_kg
    empty = float(re.findall(r"<emptywt[^>]*>\s*([-\d.]+)", text)[0]) * base.POUND / 9.80665
    heavier = mass.get("fraction", 0.0) * total
    # what comes on top is at the centre of gravity of the whole, so it moves the empty one
    text = moved(text, r"(<emptywt[^>]*>)\s*([-\d.]+)\s*(</emptywt>)", heavier * 9.80665 / base.POUND)
    cg = r'(<location name="CG"[^>]*>.*?<{0}>)\s*([-\d.]+)\s*(</{0}>)'
    for axis, sign in (("x", -1), ("y", 1), ("z", -1)):  # of the file: aft, right, up
        by = sign * offset.get(axis, 0.0) * (total + heavier) / (empty + heavier)
        text = moved(text, cg.format(axis), by / INCH)
    for axis in ("xx", "yy", "zz"):
        now = getattr(vehicle.mass_properties.inertia, axis)
        pattern = rf"(<i{axis}[^>]*>)\s*([-\d.]+)\s*(</i{axis}>)"
        text = moved(text, pattern, inertia.get(axis, 0.0) * now / (base.SLUG * base.FOOT**2))
    return text

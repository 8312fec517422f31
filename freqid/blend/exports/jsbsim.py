"""JSBSim: an ``<aerodynamics>`` section, and the least aircraft that it can be loaded and flown in.

References
----------
JSBSim Reference Manual: functions, tables, aerodynamics and mass balance sections. Its units are feet, slugs
and pounds; structural axes point aft, right and up, body axes forward, right and down.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from freqid.blend.exports.calculation import Apply, Calculation, Expression, Lookup
from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError
from freqid.core.store import replacing
from freqid.core.units import FOOT, POUND_FORCE, RHO0
from freqid.core.vehicle import Rotor, Vehicle

SLUG = POUND_FORCE / FOOT  # kg
_FUNCTIONS = {"+": "sum", "-": "difference", "*": "product", "/": "quotient"}
_FUNCTIONS |= {name: name for name in ("sqrt", "abs", "floor", "min", "max")}
_AXES = dict(zip(WRENCH, ("X", "Y", "Z", "ROLL", "PITCH", "YAW"), strict=True))
# JSBSim's own properties, and what makes them SI.
_PROPERTIES: dict[str, tuple[str, float]] = {
    **{n: (f"velocities/{n}-aero-fps", FOOT) for n in "uvw"},
    **{n: (f"velocities/{n}-aero-rad_sec", 1.0) for n in "pqr"},
    "rho": ("atmosphere/rho-slugs_ft3", SLUG / FOOT**3),
    "V": ("velocities/vt-fps", FOOT),
    "alpha": ("aero/alpha-rad", 1.0),
    "beta": ("aero/beta-rad", 1.0),
    "qbar": ("aero/qbar-psf", POUND_FORCE / FOOT**2),
}


def write_jsbsim(
    folder: Path, calculation: Calculation, vehicle: Vehicle, start: Mapping[str, float], version: str
) -> list[Path]:
    """Write a calculation as a JSBSim aircraft.

    Parameters
    ----------
    folder : Path
        Made where it is not there; its name is the aircraft's.
    calculation : Calculation
        Of a model of forces and moments, N and N m, in body axes.
    vehicle : Vehicle
        Mass properties, and rotors whose momentum couples the axes.
    start : mapping of str to float
        Inputs by label at a trim, SI, and ``theta``, rad: effectors start there, and so does the flight.
    version : str
        Of the program that writes.

    Returns
    -------
    list of Path
        ``NAME.xml``, which has mass, ``NAME-aerodynamics.xml``, the section, and ``start.xml``, a flight's
        initial condition.

    Raises
    ------
    UsageError
        For a model of other responses or of another form.
    DataError
        Where a file cannot be written.

    Notes
    -----
    Effectors are the properties ``freqid/effector/NAME``, rad, rotors rad/s, which the user sets; states are
    JSBSim's own. Responses are ``freqid/X`` to ``freqid/N`` in N and N m, and ``freqid/outside`` is 1 where
    the model is used too far away. The wrench is whole: thrust is in it, and ``<propulsion>`` is empty. The
    rotors' momentum acts beside it, ``-w x h`` of their speeds; their reaction to a change of speed is not
    there.
    """
    other = [r for r in calculation.outputs if r not in WRENCH]
    if other or calculation.form != "force":
        raise UsageError(
            f"a JSBSim aircraft needs X Y Z L M N in N and N m, found {' '.join(calculation.outputs)} in "
            f"form '{calculation.form}'",
            remedy="identify with form 'force', or export to daveml, python, csv, json or mat",
        )
    name = folder.resolve().name
    files = {
        folder / f"{name}.xml": _aircraft(name, calculation, vehicle, version),
        folder / f"{name}-aerodynamics.xml": _aerodynamics(calculation, vehicle, start),
        folder / "start.xml": _start(start),
    }
    for path, root in files.items():
        ET.indent(root)
        with replacing(path) as temporary:
            text = ET.tostring(root, encoding="unicode")
            temporary.write_text(f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n', encoding="utf-8")
    return list(files)


def _aerodynamics(calculation: Calculation, vehicle: Vehicle, start: Mapping[str, float]) -> ET.Element:
    root = ET.Element("aerodynamics")
    ET.SubElement(root, "documentation").text = " ".join(calculation.notes)
    of_user = {q.label: _effector(q.label) for q in calculation.inputs if _read(q.label, vehicle) is None} | {
        n: _effector(n) for n in _momentum_inputs(vehicle)
    }
    for label, where in of_user.items():
        ET.SubElement(root, "property", value=repr(float(start.get(label, 0.0)))).text = where
    for q in calculation.quantities:
        function = ET.SubElement(root, "function", name=f"freqid/{q.name}")
        ET.SubElement(function, "description").text = f"{q.meaning} [{q.unit}]"
        if q.value is None:
            function.append(_expression(_read(q.label, vehicle) or of_user[q.label]))
        elif isinstance(q.value, Lookup):
            table = ET.SubElement(function, "table")
            ET.SubElement(table, "independentVar", lookup="row").text = f"freqid/{q.value.of}"
            nodes = calculation.axes[q.value.axis].nodes.tolist()
            rows = zip(nodes, q.value.values.tolist(), strict=True)
            ET.SubElement(table, "tableData").text = "\n" + "".join(f"{x!r} {y!r}\n" for x, y in rows)
        else:
            function.append(_expression(_prefixed(q.value)))
    momentum = _add_momentum(root, vehicle)
    for response, axis in _AXES.items():
        element = ET.SubElement(root, "axis", name=axis)
        unit = POUND_FORCE if response in "XYZ" else POUND_FORCE * FOOT
        if response in calculation.outputs:
            function = ET.SubElement(element, "function", name=f"freqid/axis/{response}")
            whole = Apply("/", (f"freqid/{calculation.outputs[response]}", unit))
            function.append(_expression(whole))
        if response in momentum:
            function = ET.SubElement(element, "function", name=f"freqid/axis/{response}-of-rotors")
            function.append(_expression(Apply("/", (momentum[response], unit))))
    return root


def _effector(name: str) -> str:
    return f"freqid/effector/{''.join(c if c.isalnum() and c.isascii() else '_' for c in name)}"


def _read(label: str, vehicle: Vehicle) -> Expression | None:
    """Return an input as JSBSim has it, in SI; None where the user sets it."""
    if label in _PROPERTIES:
        where, factor = _PROPERTIES[label]
        return Apply("*", (where, factor)) if factor != 1.0 else Apply("+", (where, 0.0))
    length = vehicle.chord_m if label == "qhat" else vehicle.span_m
    if label in ("phat", "qhat", "rhat") and length:
        rate, speed = (
            f"velocities/{label[0]}-aero-rad_sec",
            Apply("*", ("velocities/vt-fps", 2 * FOOT / length)),
        )
        return Apply("/", (rate, speed))
    return None


def _prefixed(expression: Expression) -> Expression:
    """Return an expression whose names are properties."""
    if isinstance(expression, str):
        return f"freqid/{expression}"
    if isinstance(expression, Apply):
        return Apply(expression.operation, tuple(_prefixed(one) for one in expression.of))
    return expression


def _expression(expression: Expression) -> ET.Element:
    if isinstance(expression, str):
        element = ET.Element("property")
        element.text = expression
        return element
    if not isinstance(expression, Apply):
        element = ET.Element("value")
        element.text = repr(float(expression))
        return element
    of = [_expression(one) for one in expression.of]
    if expression.operation != "if<":
        element = ET.Element(_FUNCTIONS[expression.operation])
        element.extend(of)
        return element
    element = ET.Element("ifthen")
    ET.SubElement(element, "lt").extend(of[:2])
    element.extend(of[2:])
    return element


# The rotors' momentum -------------------------------------------------------------------------------------


def _spinning(vehicle: Vehicle) -> list[Rotor]:
    return [r for r in vehicle.rotors if r.inertia]


def _tilt_of(rotor: Rotor, vehicle: Vehicle) -> tuple[str, float]:
    """Return the effector that tilts a rotor, empty where none does, and the angle stated."""
    wing = next((w for w in vehicle.wings if w.name == rotor.wing), None)
    return (wing.tilt, vehicle.tilt_rad.get(wing.name, 0.0)) if wing else ("", 0.0)


def _momentum_inputs(vehicle: Vehicle) -> dict[str, float]:
    """Return the effectors that the rotors' momentum depends on, with their stated values."""
    found = {r.name: 0.0 for r in _spinning(vehicle)}
    return found | {tilt: at for tilt, at in (_tilt_of(r, vehicle) for r in _spinning(vehicle)) if tilt}


def _add_momentum(root: ET.Element, vehicle: Vehicle) -> dict[str, str]:
    """Add the rotors' angular momentum; return the properties of its moments by response, N m."""
    rotors = _spinning(vehicle)
    if not rotors:
        return {}

    def add(name: str, meaning: str, value: Expression) -> str:
        function = ET.SubElement(root, "function", name=f"freqid/{name}")
        ET.SubElement(function, "description").text = meaning
        function.append(_expression(value))
        return f"freqid/{name}"

    parts: dict[str, list[Expression]] = {axis: [] for axis in "xyz"}
    for rotor in rotors:
        axis = np.asarray(rotor.axis) / np.linalg.norm(rotor.axis) * rotor.spin * rotor.inertia
        x, y, z = axis.tolist()
        tilt = _tilt_of(rotor, vehicle)[0]
        speed = _effector(rotor.name)
        if tilt:  # turned about +y: x cos + z sin, y, z cos - x sin
            c, s = (f"freqid/turn/{_effector(tilt).rpartition('/')[2]}-{what}" for what in ("cos", "sin"))
            turned: dict[str, Expression] = {
                "x": Apply("+", (Apply("*", (x, c)), Apply("*", (z, s)))),
                "y": y,
                "z": Apply("-", (Apply("*", (z, c)), Apply("*", (x, s)))),
            }
        else:
            turned = {"x": x, "y": y, "z": z}
        for name, value in turned.items():
            parts[name].append(Apply("*", (speed, value)))
    for tilt in sorted({_tilt_of(r, vehicle)[0] for r in rotors} - {""}):
        for what in ("cos", "sin"):
            where = _effector(tilt)
            function = ET.SubElement(root, "function", name=f"freqid/turn/{where.rpartition('/')[2]}-{what}")
            ET.SubElement(ET.SubElement(function, what), "property").text = where
    h = {
        axis: add(
            f"momentum/{axis}",
            f"angular momentum of all rotors along {axis} body [kg m2/s]",
            Apply("+", (0.0, *of)),
        )
        for axis, of in parts.items()
    }
    p, q, r = (f"velocities/{n}-rad_sec" for n in "pqr")
    crossed = {"L": (r, h["y"], q, h["z"]), "M": (p, h["z"], r, h["x"]), "N": (q, h["x"], p, h["y"])}
    return {
        response: add(
            f"momentum/{response}",
            f"{response} of the rotors' momentum, -w x h [N m]",
            Apply("-", (Apply("*", (a, b)), Apply("*", (c, d)))),
        )
        for response, (a, b, c, d) in crossed.items()
    }


# The rest of an aircraft ----------------------------------------------------------------------------------


def _aircraft(name: str, calculation: Calculation, vehicle: Vehicle, version: str) -> ET.Element:
    """Return the least aircraft: mass, sizes, and the section by its file."""
    root = ET.Element("fdm_config", name=name, version="2.0", release="BETA")
    header = ET.SubElement(root, "fileheader")
    ET.SubElement(header, "author").text = f"freqid {version}"
    ET.SubElement(header, "description").text = (
        f"{calculation.title}. Mass and inertia are as stated for the vehicle at its stated tilts, and stay "
        "so when it tilts; aerodynamic moments are about the centre of gravity, wherever it is."
    )
    metrics = ET.SubElement(root, "metrics")
    for tag, value, unit in (
        ("wingarea", vehicle.area_m2, "M2"),
        ("wingspan", vehicle.span_m, "M"),
        ("chord", vehicle.chord_m, "M"),
    ):
        ET.SubElement(metrics, tag, unit=unit).text = repr(float(value or 1.0))
    mass = vehicle.mass_properties
    for place in ("AERORP", "EYEPOINT", "VRP"):
        _place(metrics, place, mass.cg_m)
    balance = ET.SubElement(root, "mass_balance")
    inertia = mass.inertia
    signs = {"xx": 1, "yy": 1, "zz": 1, "xy": 1, "xz": -1, "yz": 1}
    for axes, sign in signs.items():
        ET.SubElement(balance, f"i{axes}", unit="KG*M2").text = repr(sign * float(getattr(inertia, axes)))
    ET.SubElement(balance, "emptywt", unit="KG").text = repr(float(mass.mass_kg))
    _place(balance, "CG", mass.cg_m)
    ET.SubElement(root, "ground_reactions")
    ET.SubElement(root, "propulsion")
    ET.SubElement(root, "flight_control", name="none")
    ET.SubElement(root, "aerodynamics", file=f"{name}-aerodynamics.xml")
    return root


def _place(parent: ET.Element, name: str, position: tuple[float, float, float]) -> None:
    """Add a place, from vehicle axes (forward, right, down) to JSBSim's (aft, right, up)."""
    location = ET.SubElement(parent, "location", name=name, unit="M")
    for axis, sign, value in zip("xyz", (-1, 1, -1), position, strict=True):
        ET.SubElement(location, axis).text = repr(sign * float(value) + 0.0)


def _start(start: Mapping[str, float]) -> ET.Element:
    root = ET.Element("initialize", name="start")
    for axis in "uvw":
        value = float(start.get(axis, 0.0)) / FOOT
        ET.SubElement(root, f"{axis}body", unit="FT/SEC").text = repr(value)
    ET.SubElement(root, "theta", unit="RAD").text = repr(float(start.get("theta", 0.0)))
    ET.SubElement(root, "altitude", unit="FT").text = repr(_altitude(start.get("rho", RHO0)) / FOOT)
    return root


def _altitude(rho: float) -> float:
    """Return the altitude of a density in the standard troposphere, m.

    ``rho / rho0 = (1 - 0.0065 h / 288.15)^4.25588`` (ISO 2533).
    """
    return 288.15 / 0.0065 * (1 - (rho / RHO0) ** (1 / 4.25588))

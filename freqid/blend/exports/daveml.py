"""DAVE-ML: a model as the exchange format of AIAA's simulation standard, version 2.0.

References
----------
ANSI/AIAA S-119-2011, Flight Dynamics Model Exchange Standard; its markup's reference, DAVE-ML 2.0.2,
daveml.org. Order and names of elements are from there.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from pathlib import Path

from freqid.blend.exports.calculation import Apply, Calculation, CheckCase, Expression, Lookup, Quantity
from freqid.core.arrays import Array
from freqid.core.store import replacing

NAMESPACE = "http://daveml.org/2010/DAVEML"
MATHML = "http://www.w3.org/1998/Math/MathML"
DOCTYPE = (
    '<!DOCTYPE DAVEfunc PUBLIC "-//AIAA//DTD for Flight Dynamic Models - Functions 2.0//EN" '
    '"http://daveml.org/DTDs/2p0/DAVEfunc.dtd">'
)
_MATHML = {"+": "plus", "-": "minus", "*": "times", "/": "divide", "sqrt": "root"}
_MATHML |= {name: name for name in ("abs", "floor", "min", "max")}
EXACT = 1e-12
"""Tolerance of check cases beside that of tables, relative: what another order of additions may make."""


def write_daveml(path: Path, calculation: Calculation, version: str) -> None:
    """Write a calculation as DAVE-ML.

    Parameters
    ----------
    path : Path
    calculation : Calculation
    version : str
        Of the program that writes.

    Raises
    ------
    DataError
        Where the file cannot be written.

    Notes
    -----
    A quantity is a ``variableDef``, a table a ``griddedTableDef`` with the ``function`` that makes the
    quantity of it. The standard error of a parameter is a quantity, which its ``uncertainty`` names. Check
    cases hold what the model gives, not what the tables do, and the error of the tables as their tolerance.
    """
    root = ET.Element("DAVEfunc", xmlns=NAMESPACE)
    _header(root, calculation, version)
    for quantity in calculation.quantities:
        root.append(_variable(quantity, calculation))
    for name, axis in calculation.axes.items():
        definition = ET.SubElement(
            root, "breakpointDef", name=name, bpID=f"bp_{name}", units=unit_of(axis.unit)
        )
        ET.SubElement(definition, "bpVals").text = _numbers(axis.nodes)
    looked_up = [(q, q.value) for q in calculation.quantities if isinstance(q.value, Lookup)]
    for quantity, table in looked_up:
        attributes = {
            "name": quantity.name,
            "gtID": f"table_{quantity.name}",
            "units": unit_of(quantity.unit),
        }
        definition = ET.SubElement(root, "griddedTableDef", attributes)
        ET.SubElement(definition, "description").text = quantity.meaning
        references = ET.SubElement(definition, "breakpointRefs")
        ET.SubElement(references, "bpRef", bpID=f"bp_{table.axis}")
        ET.SubElement(definition, "dataTable").text = _numbers(table.values)
    for quantity, table in looked_up:
        function = ET.SubElement(root, "function", name=f"{quantity.name} of {table.of}")
        attributes = {"varID": table.of, "extrapolate": "neither", "interpolate": "linear"}
        ET.SubElement(function, "independentVarRef", attributes)
        ET.SubElement(function, "dependentVarRef", varID=quantity.name)
        definition = ET.SubElement(function, "functionDefn")
        ET.SubElement(definition, "griddedTableRef", gtID=f"table_{quantity.name}")
    if calculation.checks:
        checks = ET.SubElement(root, "checkData")
        for case in calculation.checks:
            checks.append(_shot(case, calculation))
    ET.indent(root)
    text = f'<?xml version="1.0" encoding="UTF-8"?>\n{DOCTYPE}\n{ET.tostring(root, encoding="unicode")}\n'
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _header(root: ET.Element, calculation: Calculation, version: str) -> None:
    header = ET.SubElement(root, "fileHeader", name=calculation.title)
    ET.SubElement(header, "author", name=f"freqid {version}", org="freqid")
    today = datetime.now(UTC).date().isoformat()
    ET.SubElement(header, "creationDate", date=today)
    ET.SubElement(header, "description").text = " ".join(calculation.notes)


def _variable(quantity: Quantity, calculation: Calculation) -> ET.Element:
    """Return the definition of one quantity, its parts in the standard's order."""
    attributes = {
        "name": quantity.label or quantity.name,
        "varID": quantity.name,
        "units": unit_of(quantity.unit),
    }
    if quantity.name in calculation.outputs.values():
        attributes["axisSystem"] = "body"
    if isinstance(quantity.value, float):
        attributes["initialValue"] = repr(quantity.value)
    variable = ET.Element("variableDef", attributes)
    ET.SubElement(variable, "description").text = quantity.meaning
    if isinstance(quantity.value, Apply | str):
        math = ET.SubElement(ET.SubElement(variable, "calculation"), "math", xmlns=MATHML)
        math.append(_mathml(quantity.value))
    if quantity.value is None:
        ET.SubElement(variable, "isInput")
    if quantity.name in calculation.outputs.values() or quantity.name == calculation.outside:
        ET.SubElement(variable, "isOutput")
    if quantity.std_error is not None:
        uncertainty = ET.SubElement(variable, "uncertainty", effect="additive")
        normal = ET.SubElement(uncertainty, "normalPDF", numSigmas="1")
        bounds = ET.SubElement(normal, "bounds")
        if isinstance(quantity.std_error, str):
            ET.SubElement(bounds, "variableRef", varID=quantity.std_error)
        else:
            bounds.text = repr(quantity.std_error)
        for other, value in quantity.correlation.items():
            ET.SubElement(normal, "correlation", varID=other, corrCoef=repr(value))
    return variable


def _mathml(expression: Expression) -> ET.Element:
    """Return an expression in content MathML 2."""
    if isinstance(expression, str):
        element = ET.Element("ci")
        element.text = expression
        return element
    if not isinstance(expression, Apply):
        element = ET.Element("cn")
        element.text = repr(float(expression))
        return element
    of = [_mathml(one) for one in expression.of]
    if expression.operation != "if<":
        element = ET.Element("apply")
        ET.SubElement(element, _MATHML[expression.operation])
        element.extend(of)
        return element
    element = ET.Element("piecewise")
    piece = ET.SubElement(element, "piece")
    piece.append(of[2])
    condition = ET.SubElement(piece, "apply")
    ET.SubElement(condition, "lt")
    condition.extend(of[:2])
    ET.SubElement(element, "otherwise").append(of[3])
    return element


def _shot(case: CheckCase, calculation: Calculation) -> ET.Element:
    """Return one check case."""
    shot = ET.Element("staticShot", name=case.name)
    given, made = ET.SubElement(shot, "checkInputs"), ET.Element("checkOutputs")
    for quantity in calculation.inputs:
        _signal(given, quantity, case.inputs[quantity.label])
    by_name = {q.name: q for q in calculation.quantities}
    values = calculation.evaluate(case.inputs)
    inner = ET.SubElement(shot, "internalValues") if calculation.inner else shot
    for name in calculation.inner:
        signal = ET.SubElement(inner, "signal")
        ET.SubElement(signal, "varID").text = name
        ET.SubElement(signal, "signalValue").text = repr(float(values[name][0]))
    for response, name in calculation.outputs.items():
        tolerance = case.bounds[response] + EXACT * abs(case.outputs[response])
        _signal(made, by_name[name], case.outputs[response], tolerance)
    _signal(made, by_name[calculation.outside], float(case.outside), 1e-6)
    shot.append(made)
    return shot


def _signal(parent: ET.Element, quantity: Quantity, value: float, tolerance: float | None = None) -> None:
    signal = ET.SubElement(parent, "signal")
    ET.SubElement(signal, "signalName").text = quantity.label or quantity.name
    ET.SubElement(signal, "signalUnits").text = unit_of(quantity.unit)
    ET.SubElement(signal, "signalValue").text = repr(value)
    if tolerance is not None:
        ET.SubElement(signal, "tol").text = repr(tolerance)


def _numbers(values: Array, width: int = 8) -> str:
    """Return numbers to the last digit with commas between them, some on a line."""
    words = [repr(value) for value in values.tolist()]
    return ",\n".join(", ".join(words[i : i + width]) for i in range(0, len(words), width))


def unit_of(unit: str) -> str:
    """Return a unit as the standard writes it: ``m/s`` is m_s, ``N m/(rad/s)`` is Nms_rad, 1 is nd."""
    over, under = [], []

    def sort(text: str, numerator: bool) -> None:
        """Sort the factors of one unit, whose first ``/`` outside brackets divides."""
        inner = re.fullmatch(r"\((.*)\)", text)
        if inner and inner[1].count("(") == inner[1].count(")"):
            text = inner[1]
        depth = 0
        for i, character in enumerate(text):
            depth += {"(": 1, ")": -1}.get(character, 0)
            if character == "/" and depth == 0:
                sort(text[:i], numerator)
                sort(text[i + 1 :], not numerator)
                return
        (over if numerator else under).extend(part for part in text.split() if part != "1")

    sort(unit, True)
    if not over and not under:
        return "nd"
    return "".join(over) + "".join(f"_{part}" for part in under)

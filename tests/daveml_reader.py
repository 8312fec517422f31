"""DAVE-ML read and evaluated from the words of the standard; nothing here knows who wrote the file.

After the reference of DAVE-ML 2.0 (daveml.org): variableDef, calculation, function, griddedTableDef,
independentVarRef, uncertainty, checkData. Content MathML 2 as far as aircraft models use it.
"""

import math
import re
import xml.etree.ElementTree as ET

NS = "{http://daveml.org/2010/DAVEML}"
MATH = "{http://www.w3.org/1998/Math/MathML}"

# Content models, as regular expressions over children's names with a blank after each.
ORDER = {
    "DAVEfunc": r"fileHeader (variableDef )+(breakpointDef )*(griddedTableDef )*(ungriddedTableDef )*"
    r"(function )*(checkData )?",
    "fileHeader": r"(author )+creationDate (fileVersion )?(description )?(reference )*(modificationRecord )*"
    r"(provenance )*",
    "variableDef": r"(description )?((provenance|provenanceRef) )?(calculation )?"
    r"((isInput|isControl|isDisturbance) )?(isState )?(isStateDeriv )?(isOutput )?(isStdAIAA )?"
    r"(uncertainty )?",
    "calculation": r"math ",
    "uncertainty": r"(normalPDF |uniformPDF )",
    "normalPDF": r"bounds (correlatesWith )*(correlation )*",
    "breakpointDef": r"(description )?bpVals ",
    "griddedTableDef": r"(description )?((provenance|provenanceRef) )?breakpointRefs (uncertainty )?"
    r"dataTable ",
    "breakpointRefs": r"(bpRef )+",
    "function": r"(description )?((provenance|provenanceRef) )?"
    r"((independentVarPts )+dependentVarPts |(independentVarRef )+dependentVarRef functionDefn )",
    "functionDefn": r"(griddedTableRef|griddedTableDef|ungriddedTableRef|ungriddedTableDef) ",
    "checkData": r"((provenance|provenanceRef) )?(staticShot )+",
    "staticShot": r"(description )?((provenance|provenanceRef) )?checkInputs (internalValues )?checkOutputs ",
    "checkInputs": r"(signal )+",
    "internalValues": r"(signal )+",
    "checkOutputs": r"(signal )+",
    "signal": r"(signalName signalUnits |varID |signalID )signalValue (tol )?",
    "author": r"((address )*|(contactInfo )*)",
    "bounds": r"((dataTable|variableDef|variableRef) )*",
}
# Those without text; what is in neither table holds text alone.
EMPTY = {
    "creationDate",
    "isInput",
    "isOutput",
    "variableRef",
    "bpRef",
    "independentVarRef",
    "dependentVarRef",
}
EMPTY |= {"griddedTableRef", "correlation", "correlatesWith"}
NEEDED = {
    "author": {"name", "org"},
    "creationDate": {"date"},
    "variableDef": {"name", "varID", "units"},
    "variableRef": {"varID"},
    "breakpointDef": {"bpID"},
    "griddedTableDef": {"gtID"},
    "bpRef": {"bpID"},
    "function": {"name"},
    "independentVarRef": {"varID"},
    "dependentVarRef": {"varID"},
    "griddedTableRef": {"gtID"},
    "uncertainty": {"effect"},
    "normalPDF": {"numSigmas"},
    "correlation": {"varID", "corrCoef"},
    "staticShot": {"name"},
}
# Attributes that may be there beside those that have to, and the words that some of them are of.
ALLOWED = {
    "fileHeader": {"name"},
    "author": {"xns", "email"},
    "variableDef": {"axisSystem", "sign", "alias", "symbol", "initialValue", "minValue", "maxValue"},
    "breakpointDef": {"name", "units"},
    "griddedTableDef": {"name", "units"},
    "functionDefn": {"name"},
    "independentVarRef": {"min", "max", "extrapolate", "interpolate"},
    "staticShot": {"refID"},
}
WORDS = {
    "extrapolate": {"neither", "min", "max", "both"},
    "interpolate": {"discrete", "floor", "ceiling", "linear", "quadraticSpline", "cubicSpline"},
    "effect": {"additive", "multiplicative", "percentage", "absolute"},
}


def numbers(text):
    return [float(word) for word in re.split(r"[,\s]+", text.strip())]


class Model:
    """One DAVEfunc file."""

    def __init__(self, path):
        self.path = path
        self.root = ET.parse(path).getroot()
        assert self.root.tag == NS + "DAVEfunc"
        self.variables = {v.get("varID"): v for v in self.root.findall(NS + "variableDef")}
        self.breakpoints = {
            b.get("bpID"): numbers(b.findtext(NS + "bpVals")) for b in self.root.findall(NS + "breakpointDef")
        }
        self.tables = {}
        for table in self.root.findall(NS + "griddedTableDef"):
            axes = [self.breakpoints[r.get("bpID")] for r in table.iter(NS + "bpRef")]
            values = numbers(table.findtext(NS + "dataTable"))
            assert len(values) == math.prod(map(len, axes))
            self.tables[table.get("gtID")] = axes, values
        self.functions = {
            f.find(NS + "dependentVarRef").get("varID"): f for f in self.root.findall(NS + "function")
        }

    def problems(self):
        """Return where elements or attributes are not as the standard has them, or references dangle."""
        found, ids = [], []
        tables = {"varID": self.variables, "bpID": self.breakpoints, "gtID": self.tables}
        for element in self.root.iter():
            if not element.tag.startswith(NS):
                continue
            name = element.tag[len(NS) :]
            children = "".join(c.tag.rpartition("}")[2] + " " for c in element)
            if name in ORDER and not re.fullmatch(ORDER[name], children):
                found.append(f"{name}: {children}")
            if name not in ORDER and children:
                found.append(f"{name} holds {children}")
            if name in EMPTY and (element.text or "").strip():
                found.append(f"{name} holds text")
            needed = NEEDED.get(name, set())
            found += [f"{name} lacks {a}" for a in needed - set(element.keys())]
            found += [f"{name} has {a}" for a in set(element.keys()) - needed - ALLOWED.get(name, set())]
            found += [f"{name} {k} {v}" for k, v in element.items() if v not in WORDS.get(k, {v})]
            if name == "checkOutputs":
                found += ["a check without tolerance" for s in element if s.find(NS + "tol") is None]
            ids += [
                v
                for k, v in element.items()
                if (name, k)
                in {("variableDef", "varID"), ("breakpointDef", "bpID"), ("griddedTableDef", "gtID")}
            ]
            if name.endswith("Ref") or name == "correlation":
                found += [f"no {v}" for k, v in element.items() if k in tables and v not in tables[k]]
        found += [f"{v} is no XML name" for v in ids if not re.fullmatch(r"[A-Za-z_][\w.-]*", v, re.ASCII)]
        return found + [f"{v} comes twice" for v in set(ids) if ids.count(v) > 1]

    def names(self, mark):
        """Return name and varID of the variables that have a mark, as isInput."""
        return {v.get("name"): k for k, v in self.variables.items() if v.find(NS + mark) is not None}

    def evaluate(self, inputs):
        """Return all variables for inputs by name."""
        given = {self.names("isInput")[name]: float(value) for name, value in inputs.items()}
        assert set(given) == set(self.names("isInput").values())
        known = {}
        for name in self.variables:
            self._value(name, given, known)
        return known

    def _value(self, name, given, known):
        if name in known:
            return known[name]
        variable = self.variables[name]
        calculation = variable.find(NS + "calculation")
        if name in given:
            value = given[name]
        elif calculation is not None:
            value = self._math(calculation[0][0], given, known)
        elif name in self.functions:
            value = self._function(self.functions[name], given, known)
        else:
            value = float(variable.get("initialValue"))
        value = max(value, float(variable.get("minValue", "-inf")))
        known[name] = min(value, float(variable.get("maxValue", "inf")))
        return known[name]

    def _function(self, function, given, known):
        at = []
        for reference in function.findall(NS + "independentVarRef"):
            x = self._value(reference.get("varID"), given, known)
            x = min(max(x, float(reference.get("min", "-inf"))), float(reference.get("max", "inf")))
            assert reference.get("interpolate", "linear") == "linear"
            at.append((x, reference.get("extrapolate", "neither")))
        axes, values = self.tables[function.find(f".//{NS}griddedTableRef").get("gtID")]
        return self._interpolate(axes, values, at)

    def _interpolate(self, axes, values, at):
        """Multilinear; the last axis varies fastest."""
        if not axes:
            return values[0]
        nodes, (x, extrapolate) = axes[0], at[0]
        stride = len(values) // len(nodes)
        if extrapolate not in ("min", "both"):
            x = max(x, nodes[0])
        if extrapolate not in ("max", "both"):
            x = min(x, nodes[-1])
        i = next((i for i in range(len(nodes) - 2) if x < nodes[i + 1]), len(nodes) - 2)
        low, high = (
            self._interpolate(axes[1:], values[j * stride : (j + 1) * stride], at[1:]) for j in (i, i + 1)
        )
        share = (x - nodes[i]) / (nodes[i + 1] - nodes[i])
        return (1 - share) * low + share * high

    def _math(self, node, given, known):
        kind = node.tag[len(MATH) :]
        if kind == "cn":
            return float(node.text)
        if kind == "ci":
            return self._value(node.text.strip(), given, known)
        if kind == "piecewise":
            for piece in node.findall(MATH + "piece"):
                if self._math(piece[1], given, known):
                    return self._math(piece[0], given, known)
            return self._math(node.find(MATH + "otherwise")[0], given, known)
        assert kind == "apply", kind
        operation = node[0].tag[len(MATH) :]
        of = [self._math(child, given, known) for child in node[1:]]
        if operation == "minus":
            return -of[0] if len(of) == 1 else of[0] - of[1]
        return {
            "plus": math.fsum,
            "times": math.prod,
            "divide": lambda v: v[0] / v[1],
            "power": lambda v: v[0] ** v[1],
            "root": lambda v: math.sqrt(*v),
            "abs": lambda v: abs(*v),
            "floor": lambda v: math.floor(*v),
            "min": min,
            "max": max,
            "lt": lambda v: v[0] < v[1],
            "gt": lambda v: v[0] > v[1],
        }[operation](of)

    def check_cases(self):
        """Return name, inputs, inner values and (expected, tolerance) of outputs by name, of all shots."""
        cases = []
        for shot in self.root.iter(NS + "staticShot"):
            parts = {
                part: [
                    (
                        s.findtext(NS + "signalName") or s.findtext(NS + "varID"),
                        float(s.findtext(NS + "signalValue")),
                        float(s.findtext(NS + "tol", "nan")),
                    )
                    for s in shot.findall(f"{NS}{part}/{NS}signal")
                ]
                for part in ("checkInputs", "internalValues", "checkOutputs")
            }
            inner = {name: value for name, value, _ in parts["internalValues"]}
            outputs = {name: (value, tolerance) for name, value, tolerance in parts["checkOutputs"]}
            cases.append((shot.get("name"), {n: v for n, v, _ in parts["checkInputs"]}, inner, outputs))
        return cases

    def std_error(self, name, known):
        """Return one sigma of a variable from its uncertainty."""
        normal = self.variables[name].find(f"{NS}uncertainty/{NS}normalPDF")
        bounds = normal.find(NS + "bounds")
        reference = bounds.find(NS + "variableRef")
        value = float(bounds.text) if reference is None else known[reference.get("varID")]
        return value / float(normal.get("numSigmas"))

"""DAVE-ML: well formed, read by a reader of the standard alone, and as near to the model as it says."""

import re

import daveml_reader
import exported
import numpy as np
import pytest

from freqid.blend.exports.daveml import unit_of, write_daveml
from freqid.blend.exports.exact import exact, values_at
from freqid.blend.exports.tabled import tabled
from freqid.core.errors import UsageError


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    folder, made = tmp_path_factory.mktemp("daveml"), {}

    def get(name):
        if name not in made:
            model = getattr(exported, name)()
            calculation = exact(model) if name == "point" else tabled(model)
            path = folder / f"{name}.dml"
            write_daveml(path, calculation, "0")
            made[name] = model, calculation, daveml_reader.Model(path)
        return made[name]

    return get


@pytest.mark.parametrize("name", ["point", "two_lines"])
def test_it_is_in_the_order_of_the_standard_and_passes_its_check_cases(read, name):
    _, _, file = read(name)
    assert file.problems() == []
    assert all(
        "SI units and radians" in d.text
        for d in file.root.findall(f"{daveml_reader.NS}fileHeader/{daveml_reader.NS}description")
    )
    outputs, cases = file.names("isOutput"), file.check_cases()
    assert len(cases) == 24
    assert any(expected["outside"][0] == 1 for _, _, _, expected in cases)
    for shot, inputs, inner, expected in cases:
        known = file.evaluate(inputs)
        for signal, (value, tolerance) in expected.items():
            assert abs(known[outputs[signal]] - value) <= tolerance, (shot, signal)
        assert set(expected) == set(outputs)
        for variable, value in inner.items():
            assert known[variable] == pytest.approx(value, rel=1e-12, abs=1e-12), (shot, variable)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<signalUnits>m_s</signalUnits>", "", "signal: signalName signalValue"),
        ('griddedTableRef gtID="table_', 'griddedTableRef gtID="none_', "no none_"),
        ('interpolate="linear"', 'interpolate="straight"', "independentVarRef interpolate straight"),
        ('effect="additive"', 'effect="additive" kind="normal"', "uncertainty has kind"),
        ("<isOutput />", "<isOutput>yes</isOutput>", "isOutput holds text"),
        ("<dataTable>", "<remark /><dataTable>", "griddedTableDef: description breakpointRefs remark"),
    ],
)
def test_what_the_standard_does_not_allow_is_seen(read, tmp_path, old, new, said):
    text = read("two_lines")[2].path.read_text()
    assert old in text
    (tmp_path / "x.dml").write_text(text.replace(old, new, 1))
    problems = daveml_reader.Model(tmp_path / "x.dml").problems()
    assert any(said in problem for problem in problems), problems


@pytest.mark.parametrize("name", ["one_line", "two_lines"])
def test_a_global_model_is_met_to_the_stated_error(read, name):
    model, calculation, file = read(name)
    inputs = exported.states(model, 30, seed=7)
    truth = model.wrench(inputs)
    outputs = file.names("isOutput")
    known = [file.evaluate({n: v[i] for n, v in inputs.items()}) for i in range(30)]
    for response, values in zip(model.names, truth.values, strict=True):
        error = np.abs([k[outputs[response]] for k in known] - values)
        assert error.max() <= calculation.bounds[response]
        assert calculation.bounds[response] < 0.1  # N or N m, of an aircraft of 280 N
    assert [k[outputs["outside"]] for k in known] == [0.0] * 30
    stated = re.findall(r"([XYZLMN]) ([-+.e\d]+) N(?: m)? \(largest", " ".join(calculation.notes))
    assert {r: pytest.approx(float(b), rel=6e-3) for r, b in stated} == calculation.bounds


def test_a_point_model_is_met_exactly(read):
    model, _, file = read("point")
    rng = np.random.default_rng(5)
    trims = dict(zip(model["Z"].regressors, model["Z"].trim, strict=True))
    trims |= dict(zip(model["Y"].regressors, model["Y"].trim, strict=True))
    outputs = file.names("isOutput")
    for _ in range(10):
        inputs = {n: trims[n] + 0.3 * rng.standard_normal() for n in file.names("isInput")}
        known = file.evaluate(inputs)
        for name, response in model.responses.items():
            x = np.array([inputs[n] for n in response.regressors]) - response.trim
            expected = response.bias + response.estimate @ x
            assert known[outputs[name]] == pytest.approx(expected, rel=1e-12, abs=1e-12 * abs(response.bias))


def test_parameters_carry_their_uncertainty(read):
    model, _, file = read("point")
    response = model["M"]
    for j, regressor in enumerate(response.regressors):
        assert file.std_error(f"M_{regressor}", {}) == response.std_error[j]
    correlations = file.variables["M_n2"].iter(f"{daveml_reader.NS}correlation")
    assert {c.get("varID"): float(c.get("corrCoef")) for c in correlations} == {
        f"M_{n}": response.correlation[-1, j] for j, n in enumerate(response.regressors[:-1])
    }
    model, _, file = read("one_line")
    for knot in (0, 2):
        known = file.evaluate(
            {n: float(v[0]) for n, v in model.reference(exported.SPEEDS[knot], exported.SEA).items()}
        )
        for name in ("X", "M"):
            for j, regressor in enumerate(model.corridor[name].regressors):
                found = file.std_error(f"{name}_{regressor}", known)
                assert found == pytest.approx(model.corridor[name].std_error[j, knot], rel=1e-6)


def test_every_quantity_comes_out_as_it_was_meant(read):
    model, calculation, file = read("two_lines")
    inputs = {n: v[:3] for n, v in exported.states(model, 3, seed=8).items()}
    meant = calculation.evaluate(inputs)
    for i in range(3):
        known = file.evaluate({n: v[i] for n, v in inputs.items()})
        assert set(known) == set(meant)
        for name, value in known.items():
            assert value == pytest.approx(meant[name][i], rel=1e-11, abs=1e-11), name


def test_far_off_the_corridor_it_holds_and_flags(read):
    model, calculation, file = read("two_lines")
    at = {n: v + 0 * np.zeros(1) for n, v in model.reference(9.0, 1.1).items()}
    for change in ({"u": 60.0}, {"dw1": at["dw1"] + 0.2}, {"dw2": at["dw2"] - 0.2}):
        inputs = at | change
        truth = model.wrench(inputs, outside="hold")
        known = file.evaluate({n: float(np.ravel(v)[0]) for n, v in inputs.items()})
        assert truth.outside.all()
        assert known["outside"] == 1
        scale = np.abs(truth.values[:, 0]) + 100
        found = np.array([known[file.names("isOutput")[r]] for r in model.names])
        np.testing.assert_allclose(found / scale, truth.values[:, 0] / scale, atol=1e-3)


def test_a_wrong_number_fails_a_check_case(read, tmp_path):
    _, calculation, _ = read("one_line")
    path = tmp_path / "wrong.dml"
    write_daveml(path, calculation, "0")
    text = path.read_text()
    table = text.index("<dataTable>", text.index('gtID="table_Z_w"')) + len("<dataTable>")
    values = text[table : text.index("</dataTable>", table)]
    path.write_text(text.replace(values, ", ".join(repr(1.02 * v) for v in daveml_reader.numbers(values))))
    file = daveml_reader.Model(path)
    outputs = file.names("isOutput")
    wrong = [
        abs(file.evaluate(inputs)[outputs["Z"]] - expected["Z"][0]) > expected["Z"][1]
        for _, inputs, _, expected in file.check_cases()
    ]
    assert sum(wrong) > 5


def test_a_smaller_table_error_makes_denser_tables_and_smaller_errors():
    coarse, fine = (tabled(exported.one_line(), error) for error in (1e-2, 1e-4))
    assert fine.axes["nodes"].nodes.size > 5 * coarse.axes["nodes"].nodes.size
    assert all(fine.bounds[r] < 0.1 * coarse.bounds[r] for r in "XZM")
    with pytest.raises(UsageError, match=r"nodes between two points; ask for .* or more") as refused:
        tabled(exported.one_line(), 1e-7)
    least = float(re.search(r"ask for (\S+) or", str(refused.value))[1])
    assert tabled(exported.one_line(), least).axes["nodes"].nodes.size > 1000
    with pytest.raises(UsageError, match=r"between 1e-7 and 0\.1"):
        tabled(exported.one_line(), 0.5)


def test_units_are_spelled_as_the_standard_does():
    spelled = {
        "1": "nd",
        "m/s": "m_s",
        "N/(m/s)": "Ns_m",
        "N m/(rad/s)": "Nms_rad",
        "N/rad": "N_rad",
        "kg/m3": "kg_m3",
    }
    assert {unit: unit_of(unit) for unit in spelled} == spelled


def test_values_of_a_point_are_those_of_its_formula():
    model = exported.point()
    inputs = {n: np.array([0.1, -0.2]) for n in (*model["X"].regressors, *model["Y"].regressors)}
    values, errors = values_at(model, inputs)
    r = model["Z"]
    x = np.array([inputs[n] for n in r.regressors]) - r.trim[:, None]
    np.testing.assert_allclose(values[2], r.bias + r.estimate @ x)
    np.testing.assert_allclose(
        errors[2], np.sqrt(r.bias_std_error**2 + np.einsum("in,ij,jn->n", x, r.covariance, x))
    )

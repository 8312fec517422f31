"""MATLAB structures, JSON and tables: they hold a model's numbers to the last digit."""

import csv
import json
import re
from dataclasses import replace

import exported
import numpy as np
import pytest
import tilt_wing
from scipy.io import loadmat

from freqid.blend.exports.csv_tables import write_parameters, write_record
from freqid.blend.exports.json_file import write_json
from freqid.blend.exports.mat_file import write_mat
from freqid.blend.global_model import GlobalModel
from freqid.core.errors import UsageError
from freqid.core.record import Channel


def matlab(path, name="model"):
    return loadmat(path, simplify_cells=True)[name]


def names_in(structure):
    for name, value in structure.items():
        yield name
        if isinstance(value, dict):
            yield from names_in(value)


def test_a_model_comes_back_from_matlab_exactly(tmp_path):
    model, path = exported.two_lines(), tmp_path / "m.mat"
    write_mat(path, model, "0")
    found = matlab(path)
    assert found["kind"] == "global model"
    for name, knots in model.corridor.responses.items():
        one = found["responses"][name]
        for key in ("estimate", "std_error", "trim", "covariance", "bias", "bias_std_error"):
            np.testing.assert_array_equal(one[key], getattr(knots, key))
        assert list(one["regressors"]) == list(knots.regressors)
        assert list(one["parameter_units"]) == list(knots.parameter_units)
    np.testing.assert_array_equal(found["conditions"]["scheduled"]["dw1"], model.corridor.schedule[0])
    assert path.read_bytes().startswith(b"MATLAB 5.0 MAT-file, written by freqid")
    write_mat(tmp_path / "p.mat", exported.point(), "0")
    point = matlab(tmp_path / "p.mat")["responses"]["M"]
    for key in ("estimate", "lower", "upper", "covariance"):
        np.testing.assert_array_equal(point[key], getattr(exported.point()["M"], key))


def test_names_that_matlab_refuses_are_changed_and_told(tmp_path):
    model = exported.one_line()
    corridor = replace(model.corridor, scheduled=("nac-left", "2nd flap"))
    write_mat(tmp_path / "m.mat", GlobalModel(corridor), "0")
    found = matlab(tmp_path / "m.mat")
    assert all(re.fullmatch(r"[A-Za-z]\w{0,62}", name, re.ASCII) for name in names_in(found))
    told = dict(found["original_names"].tolist())
    assert told == {"nac_left": "nac-left", "x2nd_flap": "2nd flap"}
    np.testing.assert_array_equal(found["conditions"]["scheduled"]["nac_left"], corridor.schedule[0])
    clash = replace(model.corridor, scheduled=("nac-l", "nac_l"))
    with pytest.raises(UsageError, match="MATLAB has one name, 'nac_l', for 'nac-l' and 'nac_l'"):
        write_mat(tmp_path / "clash.mat", GlobalModel(clash), "0")
    assert not (tmp_path / "clash.mat").exists()


def test_a_record_goes_to_matlab_and_to_a_table(tmp_path):
    record = tilt_wing.fly(tilt_wing.trim(9.0, 1.225), seed=1, duration=4.0).record
    write_mat(tmp_path / "r.mat", record, "0")
    found = matlab(tmp_path / "r.mat", "record")
    np.testing.assert_array_equal(found["time"], record.time)
    write_record(tmp_path / "r.csv", record)
    with (tmp_path / "r.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    table = np.array(rows, float).T
    np.testing.assert_array_equal(table[0], record.time)
    for i, (name, channel) in enumerate(record.channels.items()):
        group, short = name.split("/")
        np.testing.assert_array_equal(found[group][short], channel.values)
        assert found["units"][group][short] == channel.unit
        assert head[i + 1] == f"{name} [{channel.unit}]"
        np.testing.assert_array_equal(table[i + 1], channel.values)
    odd = record.with_channels(Channel("effector/fl.1", "rad", record.time, 25.0, ""))
    write_mat(tmp_path / "odd.mat", odd, "0")
    np.testing.assert_array_equal(matlab(tmp_path / "odd.mat", "record")["effector"]["fl_1"], record.time)


def test_json_has_all_digits_and_nothing_that_is_not_json(tmp_path):
    model, path = exported.two_lines(), tmp_path / "m.json"
    corridor = replace(model.corridor, highest_hz=float("nan"))
    write_json(path, GlobalModel(corridor), "0")
    found = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert (found["format"], found["schema"], found["highest_hz"]) == ("freqid-export", 1, None)
    for name, knots in corridor.responses.items():
        for key in ("estimate", "covariance", "bias"):
            np.testing.assert_array_equal(found["responses"][name][key], getattr(knots, key))
    assert found["inputs"] == list(model.inputs)
    assert found["conditions"]["line"] == [1] * 5 + [2] * 5


def test_the_table_has_a_row_for_each_parameter_and_condition(tmp_path):
    model, point, path = exported.one_line(), exported.point(), tmp_path / "m.csv"
    assert write_parameters(path, [point, model]) == _rows(point, model)
    with path.open(newline="") as file:
        table = list(csv.DictReader(file))
    row = next(r for r in table if (r["condition"], r["response"], r["parameter"]) == ("u9", "M", "n2"))
    j = point["M"].regressors.index("n2")
    for key in ("estimate", "std_error", "lower", "upper", "trim"):
        assert float(row[key]) == getattr(point["M"], key)[j]
    assert (row["unit"], row["regressor_unit"], row["confidence"]) == ("N m/(rad/s)", "rad/s", "0.95")
    for k, condition in enumerate(model.corridor.ids):
        knots = model.corridor["Z"]
        row = next(
            r for r in table if (r["condition"], r["response"], r["parameter"]) == (condition, "Z", "w")
        )
        value, error = knots.estimate[1, k], knots.std_error[1, k]
        assert float(row["estimate"]) == value
        assert float(row["lower"]) == pytest.approx(value - 1.959964 * error, rel=1e-6)
        assert float(row["dw1"]) == model.corridor.schedule[0, k]
        bias = next(
            r for r in table if (r["condition"], r["response"], r["parameter"]) == (condition, "Z", "bias")
        )
        assert (float(bias["estimate"]), bias["trim"]) == (knots.bias[k], "")


def _rows(point, model):
    own = sum(1 + len(r.regressors) for r in point.responses.values())
    return own + sum(
        (1 + len(r.regressors)) * len(model.corridor.ids) for r in model.corridor.responses.values()
    )

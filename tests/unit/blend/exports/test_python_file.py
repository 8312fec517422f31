"""The Python file: runs where freqid is not, checks itself, and is the model to the last digits."""

import runpy
import subprocess
import sys
from pathlib import Path

import exported
import numpy as np
import pytest

from freqid.blend.exports.exact import values_at
from freqid.blend.exports.python_file import write_python

ALONE = "import sys, runpy; sys.path.append(sys.argv[1]); runpy.run_path(sys.argv[2], run_name='__main__')"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("python")
    (folder / "only").mkdir()
    (folder / "only" / "numpy").symlink_to(Path(np.__file__).parent)
    for name in ("point", "one_line", "two_lines"):
        write_python(folder / f"{name}.py", getattr(exported, name)(), "0")
    return folder


def run_alone(folder, file):
    """Run a file in an interpreter that has the standard library and numpy, and nothing else."""
    command = [sys.executable, "-I", "-S", "-c", ALONE, str(folder / "only"), str(file)]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder)


@pytest.mark.parametrize("name", ["point", "two_lines"])
def test_it_checks_itself_where_freqid_is_not(written, name):
    done = run_alone(written, written / f"{name}.py")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("; good\n")
    assert "check cases: responses within" in done.stdout


def test_freqid_is_out_of_reach_there(written):
    (written / "reach.py").write_text("import freqid\n")
    assert "No module named 'freqid'" in run_alone(written, written / "reach.py").stderr


def test_a_changed_number_is_noticed(written):
    text = (written / "one_line.py").read_text()
    value = repr(float(exported.one_line().corridor["Z"].bias[2]))
    assert value in text
    changed = written / "changed.py"
    changed.write_text(text.replace(value, repr(1.001 * float(value)), 1))
    done = run_alone(written, changed)
    assert done.returncode == 1
    assert "NOT AS EXPECTED" in done.stdout


@pytest.mark.parametrize("name", ["one_line", "two_lines"])
def test_a_global_model_is_the_same_to_the_last_digits(written, name):
    model, module = getattr(exported, name)(), runpy.run_path(str(written / f"{name}.py"))
    inputs = exported.states(model, 200, seed=11)
    inputs["dw1"][:20] += 0.3  # off the corridor
    truth = model.wrench(inputs, outside="hold")
    values, outside = module["wrench"](inputs)
    size = np.abs(truth.values).max(axis=1, keepdims=True)
    np.testing.assert_allclose(values / size, truth.values / size, rtol=0, atol=1e-12)
    assert (outside == truth.outside).all()
    assert 0 < outside.sum() < 100
    np.testing.assert_allclose(module["standard_error"](inputs), truth.std_error, rtol=1e-9)
    one = module["wrench"](**{n: v[0] for n, v in inputs.items()})[0]
    np.testing.assert_allclose(one[:, 0], values[:, 0], rtol=1e-12)
    assert module["INPUTS"]["dw1"] == "rad"
    assert module["RESPONSES"] == {r: "N" if r in "XYZ" else "N m" for r in "XYZLMN"}


def test_a_point_model_is_the_same_to_the_last_digits(written):
    model, module = exported.point(), runpy.run_path(str(written / "point.py"))
    rng = np.random.default_rng(1)
    inputs = {n: rng.standard_normal(50) for n in module["INPUTS"]}
    values, errors = values_at(model, inputs)
    np.testing.assert_allclose(module["wrench"](inputs)[0], values, rtol=1e-12)
    np.testing.assert_allclose(module["standard_error"](inputs), errors, rtol=1e-12)
    assert module["wrench"](inputs)[1].all()
    assert not module["wrench"]({n: np.zeros(1) + t for n, t in module["DATA"]["trim"].items()})[1].any()


def test_inputs_are_checked(written):
    module = runpy.run_path(str(written / "one_line.py"))
    at = dict.fromkeys(module["INPUTS"], 0.1) | {"rho": 1.2}
    with pytest.raises(ValueError, match=r"unknown \['speed'\], missing \['q'\]"):
        module["wrench"]({n: v for n, v in at.items() if n != "q"}, speed=3.0)
    with pytest.raises(ValueError, match="finite"):
        module["wrench"](at, w=np.nan)

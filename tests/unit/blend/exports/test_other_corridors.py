"""Corridors of other aircraft: any names, one variable or many, two points, speed or a flap to run along."""

import runpy
from dataclasses import replace

import daveml_reader
import exported
import numpy as np
import pytest

from freqid.blend.exports.daveml import write_daveml
from freqid.blend.exports.python_file import write_python
from freqid.blend.exports.tabled import tabled
from freqid.blend.global_model import GlobalModel


def tilt_rotor(c):
    """Return the corridor with four nacelles that do not quite turn together, and a flap."""
    d = c.schedule[0]
    nacelles = [d, d + 0.01 * np.sin(9 * d), 0.9 * d, d - 0.01]
    names = ("nac_fl", "nac_fr", "nac_rl", "nac_rr", "flap-set")
    schedule = np.array([*nacelles, np.linspace(0.5, 0, 5)])
    return replace(c, schedule=schedule, scheduled=names, scheduled_units=("rad",) * 5)


def fixed_wing(c):
    return replace(c, schedule=np.zeros((0, 5)), scheduled=(), scheduled_units=())


def along_a_slat(c):
    """Return points of one speed and five slat settings, in percent."""
    slat = np.array([[0.0, 10, 25, 60, 100]])
    return replace(
        c, u=np.full(5, 12.0), schedule=slat, scheduled=("slat %",), scheduled_units=("1",), along="slat %"
    )


def two_points(c):
    of = [1, 3]

    def picked(knots):
        rows = {n: getattr(knots, n)[:, of] for n in ("trim", "regressor_rms", "estimate")}
        return replace(
            knots, **rows, **{n: getattr(knots, n)[of] for n in ("covariance", "bias", "bias_std_error")}
        )

    responses = {n: picked(r) for n, r in c.responses.items()}
    at = {n: getattr(c, n)[of] for n in ("u", "rho", "line")}
    return replace(c, ids=("a", "b"), schedule=c.schedule[:, of], responses=responses, **at)


@pytest.mark.parametrize("change", [tilt_rotor, fixed_wing, along_a_slat, two_points])
def test_any_corridor_is_exported_and_checks_itself(change, tmp_path, capsys):
    model = GlobalModel(change(exported.one_line().corridor))
    calculation = tabled(model)
    write_daveml(tmp_path / "m.dml", calculation, "0")
    file = daveml_reader.Model(tmp_path / "m.dml")
    assert file.problems() == []
    assert list(file.names("isInput")) == list(model.inputs)
    outputs = file.names("isOutput")
    for shot, inputs, _, expected in file.check_cases()[::4]:
        known = file.evaluate(inputs)
        for signal, (value, tolerance) in expected.items():
            assert abs(known[outputs[signal]] - value) <= tolerance, (shot, signal)
    write_python(tmp_path / "m.py", model, "0")
    assert runpy.run_path(str(tmp_path / "m.py"))["self_check"]()
    assert "good" in capsys.readouterr().out


def test_a_corridor_that_no_law_carries_to_another_density_flags_it(tmp_path):
    c = exported.one_line().corridor
    units = {
        n: tuple("1" if x == "n1" else u for x, u in zip(r.regressors, r.regressor_units, strict=True))
        for n, r in c.responses.items()
    }
    responses = {n: replace(r, regressor_units=units[n]) for n, r in c.responses.items()}
    model = GlobalModel(replace(c, responses=responses))  # n1 is a throttle now
    calculation = tabled(model)
    write_python(tmp_path / "m.py", model, "0")
    module = runpy.run_path(str(tmp_path / "m.py"))
    at = model.reference(9.0, 1.225)
    for rho, flagged in ((1.225, False), (1.225 * 1.01, False), (1.225 * 0.96, True)):
        inputs = at | {"rho": np.array([rho])}
        assert model.wrench(inputs, outside="hold").outside[0] == flagged
        assert calculation.evaluate(inputs)[calculation.outside][0] == flagged
        assert module["wrench"]({n: v for n, v in inputs.items() if n in model.inputs})[1][0] == flagged

"""Models and frequency responses as python-control objects."""

from __future__ import annotations

import sys
from dataclasses import replace

import control
import margins_case
import numpy as np
import pytest
import tilt_wing

from freqid.core.errors import DataError, UsageError
from freqid.core.results.frequency_response import FrequencyResponse


@pytest.fixture(scope="module")
def model():
    return margins_case.aircraft()


def test_the_aircraft_is_a_state_space_with_names(model):
    found = model.to_control(u=9.0, rho=1.1)
    assert isinstance(found, control.StateSpace)
    assert found.state_labels == found.output_labels == ["u", "v", "w", "p", "q", "r", "phi", "theta"]
    assert found.input_labels == ["df", "dr", "n1", "n2", "da"]
    s = 0.7j
    expected = np.linalg.solve(s * np.eye(8) - found.A, found.B)
    assert found["q", "dr"](s) == pytest.approx(expected[4, 1])


def test_heading_height_and_flow_angles_may_be_outputs(model):
    """Against the motion itself: h' of a climb, psi' of a turn, alpha of a heave."""
    found = model.to_control(u=9.0, rho=1.1, outputs=["psi", "alt", "alpha", "V", "beta"])
    assert found.state_labels[8:] == ["psi", "alt"]
    at = model.reference(9.0, 1.1)
    u, w = float(at["u"][0]), float(at["w"][0])
    theta = np.arctan2(w, u)
    speed = np.hypot(u, w)
    np.testing.assert_allclose(found.A[8, 5], 1 / np.cos(theta), rtol=1e-6)
    step = 1e-6
    for name, change in (("u", (step, 0, 0)), ("w", (0, step, 0)), ("theta", (0, 0, step))):
        du, dw, dt = change
        climb = (u + du) * np.sin(theta + dt) - (w + dw) * np.cos(theta + dt)
        j = found.state_labels.index(name)
        assert found.A[9, j] == pytest.approx(
            (climb - (u * np.sin(theta) - w * np.cos(theta))) / step, abs=1e-4
        )
        assert found.C[2, j] == pytest.approx(
            (np.arctan2(w + dw, u + du) - np.arctan2(w, u)) / step, abs=1e-5
        )
        assert found.C[3, j] == pytest.approx((np.hypot(u + du, w + dw) - speed) / step, abs=1e-5)
    assert found.C[4, 1] == pytest.approx(1 / speed)


@pytest.mark.slow
def test_draws_scatter_as_the_covariance_says(model):
    """M by the elevator at a knot, over the moment of inertia."""
    many = model.to_control(u=9.0, rho=1.1, draws=400, seed=3)
    values = np.array([one.B[4, 1] for one in many])
    knots, k = model.corridor["M"], model.corridor.ids.index("u9")
    j = knots.regressors.index("dr")
    assert values.std() == pytest.approx(knots.std_error[j, k] / 6.6, rel=0.1)
    assert values.mean() == pytest.approx(knots.estimate[j, k] / 6.6, abs=4 * values.std() / 20)
    again = model.to_control(u=9.0, rho=1.1, draws=2, seed=3)
    np.testing.assert_array_equal(again[1].B, model.to_control(u=9.0, rho=1.1, draws=2, seed=3)[1].B)


def test_a_point_model_is_one_at_its_own_condition(model):
    at = tilt_wing.trim(9.0, 1.1, tilt_wing.trim(9.0, 1.225)["dw1"])
    point = replace(tilt_wing.exact_point(at, "u9"), aircraft=tilt_wing.VEHICLE)
    found, blended = point.to_control(), model.to_control(u=9.0, rho=1.1)
    order = [found.input_labels.index(n) for n in blended.input_labels]
    np.testing.assert_allclose(found.B[:, order], blended.B, atol=1e-9)
    np.testing.assert_allclose(found.A[:, 1:], blended.A[:, 1:], atol=1e-9)
    assert len(point.to_control(draws=3)) == 3
    assert found.B.shape == point.to_control(draws=1)[0].B.shape


def test_a_frequency_response_keeps_the_lines_that_all_pairs_have():
    f = np.array([0.1, 0.2, 0.4])
    value = np.array([[[1.0 + 1j, 2.0, 3.0 - 1j]], [[np.nan, 1j, -1.0]]], dtype=complex)
    flat = np.ones((2, 1, 3))
    response = FrequencyResponse(
        ("de",),
        ("q", "w"),
        ("rad",),
        ("rad/s", "m/s"),
        f,
        value,
        flat,
        flat[:, 0],
        flat,
        flat,
        flat[:, 0],
        "windows",
    )
    found = response.to_control()
    assert isinstance(found, control.FrequencyResponseData)
    np.testing.assert_allclose(found.omega, 2 * np.pi * f[1:])
    assert found["w", "de"](2 * np.pi * 0.4j) == pytest.approx(-1.0)
    assert response.of(("de",), ("q",)).to_control().omega.size == 3
    with pytest.raises(UsageError, match="no frequency has the responses of all pairs"):
        replace(response, value=np.full((2, 1, 3), np.nan, dtype=complex)).to_control()


def test_what_is_missing_is_said(model, monkeypatch):
    with pytest.raises(UsageError, match="the speed u is not given"):
        model.to_control()
    with pytest.raises(UsageError, match="a condition is set by u and rho, not by 'dr'"):
        model.to_control(u=9.0, dr=0.1)
    with pytest.raises(UsageError, match="the motion has no 'tetha'"):
        model.to_control(u=9.0, rho=1.1, outputs=["tetha"])
    with pytest.raises(DataError, match="outside the corridor"):
        model.to_control(u=40.0, rho=1.1)
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(
        DataError, match=r"needs control, which is not installed; .*pip install 'freqid\[control\]'"
    ):
        model.to_control(u=9.0, rho=1.1)

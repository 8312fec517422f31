"""A point model by instruments comes back from its file as it went in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.results.fit import Fit
from freqid.core.results.point import ErrorsInVariables, PointModel, ResponseModel, read_point, write_point
from freqid.core.scenario import Reference


def response(beside, noise=None):
    vector, square = np.array([1.0, -2.0]), np.array([[0.04, 0.01], [0.01, 0.09]])
    axis = np.array([0.1, 0.2, 0.3])
    return ResponseModel(
        response="Z",
        unit="N",
        regressors=("w", "de"),
        regressor_units=("m/s", "rad"),
        trim=vector,
        regressor_rms=vector**2,
        estimate=vector,
        std_error=np.sqrt(np.diag(square)),
        covariance=square,
        lower=vector - 1,
        upper=vector + 1,
        bias=-280.0,
        bias_std_error=0.1,
        r2=0.97,
        pse=1.0,
        rmse=0.5,
        fit_error=0.4,
        t_statistic=vector * 5,
        variance_inflation=np.array([1.1, 1.1]),
        correlation=np.eye(2),
        condition_index=np.array([1.0, 2.0]),
        variance_proportion=np.eye(2),
        inseparable=(),
        fit={n: Fit(axis, axis + 1j, axis, noise) for n in ("frequency", "frequency 2")}
        | {n: Fit(axis, axis, axis) for n in ("time", "time 2")},
        errors_in_variables=beside,
    )


BESIDE = ErrorsInVariables(
    estimate=np.array([0.9, -1.5]),
    std_error=np.array([0.1, 0.2]),
    difference_std_error=np.array([0.05, 0.1]),
    critical=np.array([2.3, 2.4]),
    strength=np.array([40.0, 900.0]),
)


@pytest.mark.parametrize("beside", [None, BESIDE])
def test_both_estimates_and_all_remarks_are_kept(tmp_path, beside):
    model = PointModel(
        reference=Reference(id="u45", u=13.7, rho=1.2),
        responses={"Z": response(beside)},
        method="frequency",
        form="force",
        axes="body",
        confidence=0.95,
        duration=120.0,
        vehicle="test",
        estimator="least-squares" if beside is None else "instruments",
        remarks=("One thing.", "Another."),
    )
    write_point(tmp_path / "p.h5", model)
    back = read_point(tmp_path / "p.h5")
    assert (back.estimator, back.remarks) == (model.estimator, model.remarks)
    assert set(back["Z"].fit) == {"frequency", "frequency 2", "time", "time 2"}
    np.testing.assert_array_equal(back["Z"].fit["frequency 2"].measured, [0.1 + 1j, 0.2 + 1j, 0.3 + 1j])
    if beside is None:
        assert back["Z"].errors_in_variables is None
        assert back["Z"].differing == ()
        assert np.isnan(back["Z"].normalised_difference).all()
    else:
        for name in ("estimate", "std_error", "difference_std_error", "critical", "strength"):
            np.testing.assert_array_equal(getattr(back["Z"].errors_in_variables, name), getattr(beside, name))
        np.testing.assert_allclose(back["Z"].normalised_difference, [2.0, -5.0])
        assert back["Z"].differing == ("de",)


def test_what_noise_lines_tell_is_kept_and_absent_where_there_are_none(tmp_path):
    model = PointModel(
        reference=Reference(id="u45", u=13.7, rho=1.2),
        responses={"Z": response(None), "X": replace(response(None, 0.1 * np.arange(3)), response="X")},
        method="frequency",
        form="force",
        axes="body",
        confidence=0.95,
        duration=120.0,
        vehicle="test",
    )
    model.responses["X"] = replace(model["X"], distortion=1.3, r2_ceiling=0.98)
    write_point(tmp_path / "p.h5", model)
    back = read_point(tmp_path / "p.h5")
    assert (back["X"].distortion, back["X"].r2_ceiling) == (1.3, 0.98)
    np.testing.assert_array_equal(back["X"].fit["frequency 2"].noise, [0.0, 0.1, 0.2])
    assert back["X"].fit["time"].noise is None
    assert (back["Z"].distortion, back["Z"].r2_ceiling, back["Z"].fit["frequency"].noise) == (None,) * 3

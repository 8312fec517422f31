"""A global model as a prediction takes it: its derivatives and their covariance at one place."""

from __future__ import annotations

import numpy as np
import pytest
import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.blend.sealed.condition import of_global
from freqid.core.errors import DataError
from freqid.core.scenario import Reference


@pytest.fixture(scope="module")
def model():
    trims = [tilt_wing.trim(u, 1.1, tilt_wing.trim(u, 1.225)["dw1"]) for u in (6.0, 9.0, 14.0)]
    points = [tilt_wing.exact_point(at, f"{at['u']}") for at in trims]
    for point in points:  # parameters that err together
        for response in point.responses.values():
            size = 0.1 + np.abs(response.estimate) / 50
            response.covariance[...] = np.outer(size, size) * (0.7 * np.eye(size.size) + 0.3)
    return GlobalModel(line_up(points, "abc"))


def test_the_covariance_at_a_place_has_the_standard_errors_of_the_parameters(model):
    for u in (6.0, 7.7, 14.0):
        inputs = model.reference(u, 1.1)
        for name in model.names:
            covariance = model.parameter_covariance(name, inputs)
            errors = model.parameters(name, inputs).std_error[1:, 0]
            np.testing.assert_allclose(np.sqrt(np.diag(covariance)), errors, rtol=1e-9)
            assert np.linalg.eigvalsh(covariance)[0] > 0
    at_knot = model.parameter_covariance("M", model.reference(9.0, 1.1))
    correlation = at_knot / np.sqrt(np.outer(np.diag(at_knot), np.diag(at_knot)))
    np.testing.assert_allclose(correlation[~np.eye(len(correlation), dtype=bool)], 0.3, atol=1e-6)


def test_a_condition_of_the_corridor_has_the_derivatives_of_the_linear_model(model):
    reference = Reference(id="new", u=11.0, rho=1.1)
    local = of_global(model, reference, tilt_wing.VEHICLE)
    linear = model.to_statespace(reference, tilt_wing.VEHICLE)
    assert local.theta == pytest.approx(linear.trim["theta"])
    wrench = local.wrench(linear.inputs)
    np.testing.assert_allclose(wrench[:3, 8:] / 28.6, linear.B[:3], atol=1e-9)


def test_a_condition_outside_the_corridor_is_refused(model):
    with pytest.raises(DataError, match="u = 40 m/s is outside the corridor"):
        of_global(model, Reference(id="far", u=40.0, rho=1.1), tilt_wing.VEHICLE)

"""Constant sensor errors, against laws that are fitted to what a wrong sensor would have given."""

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.results.advance_ratio import (
    AdvanceRatioLaw,
    AdvanceRatioModel,
    LocalDerivatives,
    TrimCluster,
)
from freqid.identify.advance_ratio.sensor_errors import with_sensor_errors

NAMES = ("Cm.0", "Cm.alpha", "Cm.qhat")


def law(name, c, p, r):
    draws = np.tile([c, p, r, 0.0, 0.0], (4000, 1))
    return AdvanceRatioLaw(
        name, "1", "one exponential", c, np.array([p]), np.array([r]), 0.0, draws, (), 0.3, 1.0, True, 5
    )


@pytest.fixture
def model():
    local = LocalDerivatives(
        ("a",),
        NAMES,
        ("1",) * 3,
        np.ones(1),
        np.ones(1),
        np.array([20.0]),
        np.ones((1, 3)),
        np.ones((1, 3, 3)),
    )
    laws = {
        n: law(n, *of) for n, of in zip(NAMES, ((0.05, -0.3, 4), (-0.9, -1, 3), (-14, -30, 4)), strict=True)
    }
    return AdvanceRatioModel((TrimCluster(local, laws),))


@pytest.mark.parametrize(("name", "power"), [("Cm.alpha", 2), ("Cm.qhat", 1)])
def test_airspeed_moves_value_and_advance_ratio(model, name, power):
    """Two per cent of airspeed, one sigma: the exact change at +-1 sigma is inside and at the 68 % limits."""
    wide = with_sensor_errors(model, {"V": 0.4}).clusters[0][name]
    exact = model.clusters[0][name]
    for j in (0.4, 0.8, np.inf):
        low, high = np.sort([(1 + e) ** power * exact.value(j * (1 + e)) for e in (-0.02, 0.02)])
        np.testing.assert_allclose(wide.interval(j, 0.6827), [low, high], rtol=3e-3)
    assert wide.value(0.5) == exact.value(0.5)


def test_angle_of_attack_moves_the_constant_by_its_derivative(model):
    wide = with_sensor_errors(model, {"alpha": 0.01}).clusters[0]
    slope = model.clusters[0]["Cm.alpha"]
    for j in (0.4, np.inf):
        assert wide["Cm.0"].std_error_at(j) == pytest.approx(0.01 * abs(slope.value(j)), rel=0.05)
        assert wide["Cm.alpha"].std_error_at(j) == pytest.approx(0, abs=1e-12)


def test_other_sensors_and_missing_airspeed_are_said(model):
    with pytest.raises(UsageError, match=r"'alfa' is stated.*did you mean 'alpha'"):
        with_sensor_errors(model, {"alfa": 0.1})
    with pytest.raises(UsageError, match="expected zero or more"):
        with_sensor_errors(model, {"V": -0.1})
    cluster = model.clusters[0]
    unknown = replace(cluster, local=replace(cluster.local, airspeed=np.array([np.nan])))
    with pytest.raises(UsageError, match="do not state their airspeed"):
        with_sensor_errors(replace(model, clusters=(unknown,)), {"V": 0.1})

"""Products of regressors: which are tried, what they are of a flight, and what the settings say of them."""

from __future__ import annotations

from unittest.mock import MagicMock

import msgspec
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.results.point import read_point, write_point
from freqid.core.sections.identification import Identification
from freqid.core.toml import convert
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.identify.advance_ratio.local import expand_about_zero
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.model.selection import candidate_products
from freqid.identify.output_error.forms.form import Loads
from freqid.identify.output_error.point_model import _response
from freqid.identify.point import identify_point, predict_responses

UNITS = {"w": "m/s", "p": "rad/s", "de1": "rad", "de2": "rad", "n1": "rad/s", "n2": "rad/s"}


def flown(w, de, n1):
    time = np.arange(w.size) * 0.02
    rows = {"state/w": ("m/s", w), "effector/de": ("rad", de), "effector/n1": ("rad/s", n1)}
    z = 3.0 + 2.0 * w - 5.0 * (de - 0.1) + 4.0 * (w - 0.5) * (de - 0.1) + 0.02 * (n1 - 400.0) ** 2
    rows["response/Z"] = ("N", z)
    body = MassProperties(mass_kg=1.0, inertia=Inertia(xx=1, yy=1, zz=1))
    channels = {n: Channel(n, unit, v, 50.0, "test") for n, (unit, v) in rows.items()}
    return Maneuver(FlightRecord(time, channels), Vehicle(name="test", mass_properties=body))


def bent_flight(seed, about=0.5):
    """Periodic, so that trends and ends say nothing; `about` is where w was flown."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * np.arange(2501) / 2500
    tones = np.array([[np.sin(k * turn + rng.uniform(0, 6)) for k in range(j, j + 36, 3)] for j in (2, 3, 4)])
    w, de, n1 = tones.sum(axis=1)
    return flown(about + w, 0.1 + 0.05 * de, 400.0 + 3.0 * n1)


SETTINGS = Identification(
    regressors=("w", "de", "n1", "w*de", "n1*n1"),
    responses=("Z",),
    frequencies_hz=tuple((np.arange(2, 80) / 50).tolist()),
    response_source="record",
    trend="mean",
    nuisance="none",
)


def test_what_acts_together_is_tried():
    tried = set(candidate_products(UNITS))
    assert {"w*w", "w*p", "w*de1", "w*n1", "p*n1", "de1*n2", "de1*de1", "n1*n1"} <= tried
    assert not tried & {"de1*de2", "n1*n2", "p*p", "p*de1"}


def test_a_product_is_of_departures_from_the_trim():
    flight = bent_flight(0)
    w, de = flight.record["state/w"], flight.record["effector/de"]
    values, units = explanatory_variables(flight, ("w*de", "w*w"), {"w": 0.3, "de": 0.2})
    np.testing.assert_allclose(values, [(w - 0.3) * (de - 0.2), (w - 0.3) ** 2], rtol=1e-14)
    assert units == ("m/s rad", "m/s m/s")
    own = explanatory_variables(flight, ("w*de",))[0]
    np.testing.assert_allclose(own[0], (w - w.mean()) * (de - de.mean()), rtol=1e-14)


@pytest.mark.parametrize("method", ["frequency", "time"])
def test_named_products_are_identified_and_predict_a_flight_about_another_trim(method):
    settings = msgspec.structs.replace(SETTINGS, method=method)
    model = identify_point(bent_flight(0), settings)
    found = dict(zip(model["Z"].regressors, model["Z"].estimate, strict=True))
    assert found["w*de"] == pytest.approx(4.0, rel=1e-4)
    assert found["n1*n1"] == pytest.approx(0.02, rel=1e-4)
    assert model["Z"].regressor_units[3:] == ("m/s rad", "rad/s rad/s")
    fit = predict_responses(model, bent_flight(1, about=0.9), settings)["Z"]
    assert fit.r2 > 0.9999


def test_two_flights_about_different_trims_share_their_products():
    """Were each product of its own flight's departures, slopes would differ by 4 x 0.8 rad between them."""
    model = identify_point([bent_flight(0), bent_flight(1, about=1.3)], SETTINGS)
    assert model["Z"]["w*de"][0] == pytest.approx(4.0, rel=1e-6)
    # d Z / d de = -5 + 4 (w - 0.5) at the mean w of both flights
    assert model["Z"]["de"][0] == pytest.approx(-5.0 + 4.0 * (model["Z"].trim[0] - 0.5), rel=1e-6)


def test_a_model_with_products_survives_its_file(tmp_path):
    model = identify_point(bent_flight(0), SETTINGS)
    write_point(tmp_path / "point.h5", model)
    read = read_point(tmp_path / "point.h5")
    assert read["Z"].regressors == SETTINGS.regressors
    assert read["Z"]["w*de"] == model["Z"]["w*de"]
    assert predict_responses(read, bent_flight(1), SETTINGS)["Z"].r2 > 0.9999


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"regressors": ["w", "w*de"]}, "product 'w*de' without 'de', expected both factors"),
        ({"regressors": ["w", "w*w*w"]}, "'w*w*w' of 'Z' has 3 factors, expected two"),
        ({"nonlinear": "products"}, "residuals 'coloured', expected 'noise-lines'"),
        ({"structure": "stepwise", "method": "time"}, "expected method 'frequency'"),
    ],
)
def test_settings_that_do_not_fit_are_refused(changes, said):
    with pytest.raises(UsageError, match=said.replace("*", r"\*")):
        convert({"regressors": ["w"], "responses": ["Z"], **changes}, Identification, "scenario.toml")


def test_about_zero_a_model_with_products_has_the_loads_own_constant():
    """A model's bias is the load at the mean of the products, not where they are zero."""
    value, _ = expand_about_zero(identify_point(bent_flight(0), SETTINGS)["Z"])
    constant = 3.0 + 5.0 * 0.1 + 4.0 * 0.5 * 0.1 + 0.02 * 400.0**2
    np.testing.assert_allclose(value[:3], [constant, 2.0 - 4.0 * 0.1, -5.0 - 4.0 * 0.5], rtol=1e-4)


def test_output_error_states_the_load_at_the_means_as_equation_error_does():
    """Its own bias is the load where departures are zero; the point model's, at the mean of their product."""
    rng = np.random.default_rng(3)
    w = rng.normal(size=2501)
    flight = flown(w, 0.1 + 0.05 * w + 0.01 * rng.normal(size=2501), 400.0 + w)
    regressors = ("w", "de", "w*de")
    names = [f"Z_{n}" for n in (*regressors, "bias")]
    values = dict(zip(names, (2.0, -5.0, 4.0, 3.0), strict=True))
    result = MagicMock(
        names=tuple(names), not_excited={}, covariance=np.eye(4), upper=np.ones(4), lower=-np.ones(4)
    )
    result.__getitem__.side_effect = lambda name: (values[name], 0.01)
    settings = Identification(regressors=regressors, responses=("Z",), response_source="record")
    model = _response("Z", result, [flight], settings, None, None)
    at_means = Loads((("Z", regressors),), "force", ()).of(
        {}, {"w": 0.7, "de": 0.2, "trim_w": w.mean(), "trim_de": flight.record["effector/de"].mean()}, values
    )
    away = np.array([0.7 - w.mean(), 0.2 - flight.record["effector/de"].mean()])
    x = np.append(model.trim[:2] + away, away.prod())
    assert abs(model.estimate[2] * model.trim[2]) > 0.1
    assert model.bias + model.estimate @ (x - model.trim) == pytest.approx(at_means["Z"])

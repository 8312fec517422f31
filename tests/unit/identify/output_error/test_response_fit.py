"""Fits to frequency responses against responses that are written down."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.identify.output_error.model import DynamicModel
from freqid.identify.output_error.response_fit import fit_model, fit_transfer_function

F = np.geomspace(0.1, 3.0, 40)
S = 2j * np.pi * F
TRUE = {"b0": -5.0, "b1": -3.0, "a0": 6.0, "a1": 1.6, "tau": 0.08}


def second_order(p):
    return np.exp(-p["tau"] * S) * (p["b1"] * S + p["b0"]) / (S**2 + p["a1"] * S + p["a0"])


def measured(value, std, inputs=("de",), outputs=("q",)):
    shape = (len(outputs), len(inputs), F.size)
    one = np.full(shape, 0.98)
    return FrequencyResponse(
        inputs,
        outputs,
        ("rad",) * len(inputs),
        ("rad/s",) * len(outputs),
        F,
        np.reshape(value, shape),
        np.reshape(std, shape),
        np.full((len(outputs), F.size), 8.0),
        one,
        one,
        np.full((len(outputs), F.size), np.nan),
        "sweeps",
    )


def noisy(rng, value, std):
    return value + std * (rng.standard_normal(value.shape) + 1j * rng.standard_normal(value.shape))


def test_a_transfer_function_with_a_delay_is_found_to_the_last_digit():
    exact = second_order(TRUE)
    found = fit_transfer_function(measured(exact, 0.02 * np.abs(exact)), "q", "de", 1, 2)
    assert dict(zip(found.parameters, found.estimate, strict=True)) == pytest.approx(TRUE, rel=1e-6)
    np.testing.assert_allclose(found.value[0, 0], exact, rtol=1e-6)
    assert found.weighted_error < 1e-6


def test_bounds_are_the_scatter_of_repeated_fits():
    """Repeated fits in noise; the bound is the scatter, the insensitivity is what one parameter alone has."""
    rng = np.random.default_rng(0)
    exact = second_order(TRUE)
    std = 0.02 * np.abs(exact) + 0.01
    fits = [fit_transfer_function(measured(noisy(rng, exact, std), std), "q", "de", 1, 2) for _ in range(24)]
    scatter = np.std([x.estimate for x in fits], axis=0)
    bound = np.mean([x.cramer_rao for x in fits], axis=0)
    assert np.all((bound / scatter > 0.65) & (bound / scatter < 1.6))
    assert np.mean([x.weighted_error for x in fits]) == pytest.approx(1.0, abs=0.1)
    # of the delay alone, all else held: information is sum |dG/dtau|^2 / s^2
    alone = 1 / np.sqrt(np.sum(np.abs(S * exact) ** 2 / np.hypot(std, 1e-3 * np.abs(exact)) ** 2))
    tau = fits[0].parameters.index("tau")
    inflated = np.sqrt(np.maximum([x.weighted_error for x in fits], 1.0))
    assert np.mean([x.insensitivity[tau] for x in fits] / inflated) == pytest.approx(alone, rel=0.05)


def short_period():
    def equations(x, u, p):
        rates = {
            "w": p["Zw"] * x["w"] + 20.0 * x["q"] + p["Zde"] * u["de"],
            "q": p["Mw"] * x["w"] + p["Mq"] * x["q"] + p["Mde"] * u["de"] + p["Mdf"] * u["df"],
        }
        return rates, {"w": x["w"], "q": x["q"]}

    names = ("Zw", "Zde", "Mw", "Mq", "Mde", "Mdf", "tau")
    return DynamicModel(
        "short period by hand",
        ("w", "q"),
        ("de", "df"),
        ("w", "q"),
        names,
        equations,
        delays={"de": "tau"},
        units={"tau": "s"},
    )


VALUES = {"Zw": -3.0, "Zde": -2.0, "Mw": -1.4, "Mq": -4.0, "Mde": -12.0, "Mdf": 2.5, "tau": 0.06}


def by_hand():
    """The same, solved by Cramer's rule."""
    p, late = VALUES, np.exp(-VALUES["tau"] * S)
    determinant = (S - p["Zw"]) * (S - p["Mq"]) - 20.0 * p["Mw"]
    found = np.empty((2, 2, F.size), dtype=complex)
    for i, (z, m) in enumerate(((p["Zde"] * late, p["Mde"] * late), (0.0, p["Mdf"]))):
        found[0, i] = ((S - p["Mq"]) * z + 20.0 * m) / determinant
        found[1, i] = (p["Mw"] * z + (S - p["Zw"]) * m) / determinant
    return found


def test_a_state_space_model_with_a_delay_starts_from_its_own_equations():
    rng = np.random.default_rng(1)
    exact = by_hand()
    std = 0.02 * np.abs(exact)
    response = measured(noisy(rng, exact, std), std, ("de", "df"), ("state/w", "state/q"))
    found = fit_model(response, short_period(), {})
    off = [abs(found[n][0] - VALUES[n]) / found[n][1] for n in VALUES]
    assert max(off) < 3.5
    assert found.units[found.parameters.index("tau")] == "s"
    # an input that was not measured leaves its parameter out
    alone = fit_model(response.of(("de",), response.outputs), short_period(), {})
    assert "Mdf" not in alone.parameters
    held = fit_model(response, short_period(), {}, fixed={"Mq": -4.0, "tau": 0.06})
    assert "Mq" not in held.parameters
    assert held["Mde"][1] < found["Mde"][1]


def test_what_cannot_be_fitted_is_said():
    exact = second_order(TRUE)
    response = measured(exact, 0.02 * np.abs(exact))
    with pytest.raises(UsageError, match="no output"):
        fit_model(measured(exact, np.abs(exact), ("de",), ("p",)), short_period(), {})
    with pytest.raises(UsageError, match="'Zw' has no start: state 'w'"):
        fit_model(response, short_period(), {})
    with pytest.raises(UsageError, match="no parameter 'Mx'"):
        fit_model(response, short_period(), {}, start={"Mx": 1.0})
    with pytest.raises(DataError, match="no response is known"):
        fit_transfer_function(response, "q", "de", 1, 2, band_hz=(10.0, 20.0))
    with pytest.raises(UsageError, match="at most one order more"):
        fit_transfer_function(response, "q", "de", 4, 2)

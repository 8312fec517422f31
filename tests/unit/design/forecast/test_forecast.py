"""The forecast against a dense least-squares problem, its scaling laws, and the shortest manoeuvre."""

from dataclasses import replace

import numpy as np
import pytest
from linear_design import AMPLITUDE, GAINS, NOISE, SCENARIO, VEHICLE, design

from freqid.core.errors import UsageError
from freqid.core.toml import overridden
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.design.forecast.standard_errors import forecast, shortest

SETTINGS = SCENARIO.identification
SENSED = {n: s if n in ("p", "q", "r", "ax", "ay", "az") else 0.0 for n, s in NOISE.items()}
CLEAN_REGRESSORS = overridden(SETTINGS, responses=("X", "Y", "Z"))


@pytest.fixture(scope="module")
def loop(linear_aircraft):
    return perturbed_aircraft(linear_aircraft.DERIVATIVES, VEHICLE, u=20.0, gains=GAINS)


@pytest.fixture(scope="module")
def made(loop):
    return forecast(design(), loop, SETTINGS, NOISE)


def test_white_response_noise_gives_the_covariance_of_stacked_least_squares(linear_aircraft, loop):
    """Force residuals are m times accelerometer noise where the regressors have none."""
    flown = design(periods=3)
    quiet = dict.fromkeys(NOISE, 0.0) | dict.fromkeys(("ax", "ay", "az"), 0.1)
    plain = overridden(CLEAN_REGRESSORS, nuisance="none")
    got = forecast(flown, loop, plain, quiet)["Z"]

    names = ("u", "w", "q", "de", "n1")
    columns = []
    for signal in flown.signals:
        unit = loop.response(names, (signal.name,), signal.index / flown.period_s)[:, 0]
        columns.append(unit * signal.amplitude * np.exp(1j * signal.phase) * flown.duration_s / 2)
    x = np.concatenate(columns, axis=1)
    stacked = np.concatenate([x.real, x.imag], axis=1)
    # Of a transform by a sum of N samples times dt; each of its two parts has half the variance.
    variance = (linear_aircraft.MASS * 0.1) ** 2 * flown.dt_s * flown.duration_s / 2
    np.testing.assert_allclose(got.covariance, variance * np.linalg.inv(stacked @ stacked.T), rtol=1e-8)
    np.testing.assert_allclose(got.parameter, [linear_aircraft.DERIVATIVES["Z"][n] for n in names], rtol=1e-9)
    np.testing.assert_allclose(got.bias, 0.0, atol=1e-12)
    assert (got.regressors, got.unit) == (names, "N")


def test_figures_are_those_of_the_covariance(made):
    for response in made.responses.values():
        p = len(response.regressors)
        np.testing.assert_allclose(np.diag(response.correlation), 1.0)
        information = np.linalg.inv(response.covariance)
        assert response.det_figure == pytest.approx(np.linalg.det(information) ** (1 / p), rel=1e-6)
    each = [made[r].det_figure for r in "XYZLMN"]
    assert made.det_figure == pytest.approx(np.prod(each) ** (1 / 6))  # five parameters each


def test_twice_the_amplitude_or_four_times_the_periods_halves_the_errors(loop):
    quiet = {n: s if n.startswith("a") else 0.0 for n, s in NOISE.items()}
    once = forecast(design(), loop, CLEAN_REGRESSORS, quiet)
    signals = tuple(replace(s, amplitude=2 * s.amplitude) for s in design().signals)
    strong = forecast(replace(design(), signals=signals), loop, CLEAN_REGRESSORS, quiet)
    long = forecast(design(periods=8), loop, CLEAN_REGRESSORS, quiet)
    for name in "XYZ":
        np.testing.assert_allclose(strong[name].std_error, once[name].std_error / 2, rtol=1e-9)
        np.testing.assert_allclose(long[name].std_error, once[name].std_error / 2, rtol=1e-9)


def test_noise_in_regressors_shrinks_estimates_and_the_less_the_more_periods_are_flown(loop, made):
    long = forecast(design(periods=20), loop, SETTINGS, NOISE)
    for name, j in (("Z", 1), ("L", 1), ("N", 0)):
        assert made[name].bias[j] * made[name].parameter[j] < 0
        assert abs(made[name].bias[j]) > 0.5 * made[name].std_error[j]
    # Ten times the periods have 100 times the signal's power on a line, and 10 times the noise's.
    np.testing.assert_allclose(long["Z"].bias * 10, made["Z"].bias, rtol=0.15, atol=0.3)


def test_the_accelerometers_arm_and_rates_noise_reach_the_forces(loop):
    shaky = SENSED | dict.fromkeys("pqr", 0.02)
    near = forecast(design(), loop, CLEAN_REGRESSORS, shaky)
    far = forecast(design(), loop, CLEAN_REGRESSORS, shaky, accelerometer_m=(1.5, 0.0, 0.0))
    np.testing.assert_allclose(
        far["X"].std_error, near["X"].std_error, rtol=0.05
    )  # only the end-sample column
    assert (far["Z"].std_error > 1.2 * near["Z"].std_error).all()


def test_flow_angles_are_velocities_in_other_units(loop, made):
    names = {"Z": ("u", "alpha", "q", "de", "n1"), "Y": ("beta", "p", "r", "da", "dr")}
    angles = forecast(design(), loop, overridden(SETTINGS, responses=("Y", "Z"), regressors=names), NOISE)
    velocities = forecast(design(), loop, overridden(SETTINGS, responses=("Y", "Z")), NOISE)
    assert angles["Z"].std_error[1] == pytest.approx(20.0 * velocities["Z"].std_error[1], rel=1e-9)
    assert angles["Y"].parameter[0] == pytest.approx(20.0 * made["Y"].parameter[0])


def test_empty_harmonics_only_cost_their_power(loop):
    """Lines without power take no part where the regressors have no noise."""
    full = design(combs={"de": [2, 9, 17], "da": [4, 12, 19], "dr": [5, 13, 21], "n1": [7, 15, 24]})
    narrow = replace(full, band_hz=(0.1, 1.2))
    for name in "XYZ":
        wide_error = forecast(full, loop, CLEAN_REGRESSORS, SENSED)[name].std_error
        expected = forecast(narrow, loop, CLEAN_REGRESSORS, SENSED)[name].std_error
        np.testing.assert_allclose(wide_error, expected, rtol=0.01)


def test_what_a_forecast_cannot_be_made_of_is_named(loop):
    noise = {n: s for n, s in NOISE.items() if n not in ("w", "az")}
    with pytest.raises(UsageError, match="noise of w, az is not stated, and response 'Z'"):
        forecast(design(), loop, overridden(SETTINGS, responses=("Z",)), noise)
    with pytest.raises(UsageError, match="all noise that response 'X' depends on is zero"):
        forecast(design(), loop, SETTINGS, dict.fromkeys(NOISE, 0.0))
    with pytest.raises(UsageError, match="form 'coefficient'"):
        forecast(design(), loop, overridden(SETTINGS, form="coefficient"), NOISE)
    still = overridden(SETTINGS, responses=("Z",), regressors=("w", "v"))
    with pytest.raises(UsageError, match="regressor 'v' of 'Z' does not move"):
        forecast(only(design(), "de", "n1"), loop, still, NOISE)
    alike = overridden(SETTINGS, responses=("Z",), regressors=("w", "alpha", "de"))
    with pytest.raises(UsageError, match="does not separate w, alpha in response 'Z'"):
        forecast(design(), loop, alike, NOISE)
    with pytest.raises(UsageError, match=r"harmonic 31 of 'de', 1\.55 Hz, is outside"):
        forecast(
            design(combs={"de": [3, 31], "da": [4], "dr": [5], "n1": [6]}),
            loop,
            SETTINGS,
            NOISE,
        )


def only(full, *names):
    return replace(full, signals=tuple(s for s in full.signals if s.name in names))


def test_the_shortest_manoeuvre_suffices_and_one_period_less_does_not(loop, made):
    reached = forecast(design(periods=7), loop, SETTINGS, NOISE)
    wanted = {"M": {"w": reached["M"].std_error[1] * 1.02}, "Y": {"dr": 1e3}}
    found = shortest(design(), loop, SETTINGS, NOISE, wanted)
    assert found.design.periods == 7
    assert found.design.duration_s == 140.0
    np.testing.assert_allclose(found["M"].std_error, reached["M"].std_error)
    shorter = forecast(design(periods=6), loop, SETTINGS, NOISE)
    assert shorter["M"].std_error[1] > wanted["M"]["w"]
    assert shortest(design(), loop, SETTINGS, NOISE, {"M": {"w": 1e3}}).design.periods == 1


def test_an_accuracy_out_of_reach_is_refused_with_the_nearest_feasible(loop):
    best = forecast(design(periods=5), loop, SETTINGS, NOISE)["N"].std_error[0]
    with pytest.raises(
        UsageError, match=f"'v' in 'N' is out of reach: 5 periods, 100 s, reach {best:.4g}"
    ) as caught:
        shortest(design(), loop, SETTINGS, NOISE, {"N": {"v": best / 2}}, longest_s=110.0)
    assert caught.value.remedy is not None
    longer = float(caught.value.remedy.split("about ")[1].split(" s")[0])
    assert shortest(design(), loop, SETTINGS, NOISE, {"N": {"v": best / 2}}, longest_s=1.05 * longer)
    with pytest.raises(UsageError, match="longer than the 10 s allowed"):
        shortest(design(), loop, SETTINGS, NOISE, {"N": {"v": 1.0}}, longest_s=10.0)


@pytest.mark.parametrize("wanted", [{"K": {"v": 1.0}}, {"N": {"w": 1.0}}, {"N": {"v": 0.0}}])
def test_a_wanted_accuracy_has_to_be_of_an_identified_parameter(loop, wanted):
    with pytest.raises(UsageError, match="correct the wanted accuracy"):
        shortest(design(), loop, SETTINGS, NOISE, wanted)


def test_every_effector_of_the_cases_is_excited():
    assert design().names == tuple(AMPLITUDE)

"""Optimal amplitudes: inside the limits, against brute force, and what cannot be asked."""

from dataclasses import replace

import numpy as np
import pytest
from linear_design import AMPLITUDE, GAINS, NOISE, SCENARIO, VEHICLE, design

from freqid.core.errors import UsageError
from freqid.core.toml import overridden
from freqid.design.forecast.excursions import excursions
from freqid.design.forecast.limits import effector_travel
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.design.forecast.optimal import optimal_amplitudes
from freqid.design.forecast.standard_errors import forecast

# Without noise in the regressors the criterion and the forecast agree to the nuisance columns, which
# do not matter for forces when there are none.
SETTINGS = overridden(SCENARIO.identification, responses=("X", "Y", "Z"), nuisance="none")
QUIET = {n: s if n.startswith("a") else 0.0 for n, s in NOISE.items()}
TRIM = {"de": 0.02, "n1": 420.0}


@pytest.fixture(scope="module")
def loop(linear_aircraft):
    return perturbed_aircraft(linear_aircraft.DERIVATIVES, VEHICLE, u=20.0, gains=GAINS)


def limits():
    allowed, rates = effector_travel(VEHICLE, tuple(AMPLITUDE), TRIM)
    return allowed | {"theta": 0.08, "phi": 0.12, "w": 1.5, "Z": 150.0}, rates | {"de": 0.6}


def scaled(start, scale):
    signals = tuple(replace(s, amplitude=s.amplitude * f) for s, f in zip(start.signals, scale, strict=True))
    return replace(start, signals=signals)


def largest_share(loop, flown):
    """Largest peak over its limit, recomputed from histories."""
    allowed, rates = limits()
    peak = excursions(flown, loop, tuple(allowed)).peak / list(allowed.values())
    rate = excursions(flown, loop, tuple(rates), rate=True).peak / list(rates.values())
    return max(peak.max(), rate.max())


@pytest.mark.parametrize("criterion", ["A", "D"])
def test_no_amplitudes_inside_the_limits_are_better(loop, criterion):
    start = design()
    before = forecast(start, loop, SETTINGS, QUIET)
    found = optimal_amplitudes(start, loop, SETTINGS, QUIET, *limits(), criterion=criterion)
    assert largest_share(loop, found.design) <= 1 + 1e-9
    assert largest_share(loop, found.design) > 1 - 2e-3

    def figure(flown):
        got = forecast(flown, loop, SETTINGS, QUIET)
        if criterion == "D":
            return -np.log(got.det_figure)
        ratios = [got[r].std_error / before[r].std_error for r in SETTINGS.responses]
        return np.log(np.mean(np.concatenate(ratios) ** 2))

    best = figure(found.design)
    assert best == pytest.approx(found.figure, abs=1e-6)
    rng = np.random.default_rng(1)
    for width in (0.03, 0.3, 1.5):
        for _ in range(60):
            trial = scaled(start, found.scale * np.exp(width * rng.standard_normal(4)))
            trial = scaled(trial, np.full(4, 1 / largest_share(loop, trial)))
            assert figure(trial) > best - 2e-3  # what the limits are kept to


def test_the_two_criteria_differ_and_say_what_binds(loop):
    by_a, by_d = (optimal_amplitudes(design(), loop, SETTINGS, QUIET, *limits(), criterion=c) for c in "AD")
    assert np.abs(np.log(by_a.scale / by_d.scale)).max() > 0.01
    assert by_d.binding == ("theta", "phi", "rate of de")
    peaks = excursions(by_d.design, loop, ("theta", "phi", "w", "Z")).peak / [0.08, 0.12, 1.5, 150.0]
    np.testing.assert_allclose(peaks[:2], 1.0, atol=0.01)
    assert peaks[2:].max() < 0.98
    assert by_d.design.provenance["amplitudes"] == "D-optimal, held back by theta, phi, rate of de"
    again = optimal_amplitudes(design(), loop, SETTINGS, QUIET, *limits(), criterion="D")
    np.testing.assert_array_equal(again.scale, by_d.scale)


def test_with_effector_limits_alone_each_effector_uses_all_of_its_room():
    table = {c: {s: -30.0} for c, s in zip("XYZLMN", "uvwpqr", strict=True)}
    table["L"]["da"], table["M"]["de"] = 30.0, -30.0
    loop = perturbed_aircraft(table, VEHICLE, u=20.0, gains=GAINS)
    allowed = {"de": 0.1, "da": 0.2, "dr": 0.3, "n1": 50.0}
    each = overridden(SETTINGS, regressors={"X": ("n1", "de"), "Y": ("dr",), "Z": ("da",)})
    found = optimal_amplitudes(design(), loop, each, QUIET, allowed)
    peak = excursions(found.design, loop, tuple(allowed)).peak
    np.testing.assert_allclose(peak, list(allowed.values()), rtol=2e-3)
    assert found.binding == tuple(allowed)


def test_wanted_errors_weigh_the_parameters(loop):
    errors = {"Y": {"dr": 1e-3}}
    plain = optimal_amplitudes(design(), loop, SETTINGS, QUIET, *limits(), criterion="A")
    keen = optimal_amplitudes(design(), loop, SETTINGS, QUIET, *limits(), criterion="A", wanted=errors)
    error = [forecast(o.design, loop, SETTINGS, QUIET)["Y"].std_error[4] for o in (plain, keen)]
    assert error[1] < 0.97 * error[0]


def test_room_is_the_distance_to_the_nearer_limit():
    allowed, rates = effector_travel(VEHICLE, tuple(AMPLITUDE), TRIM)
    assert allowed == pytest.approx({"de": 0.48, "da": 0.5, "dr": 0.5, "n1": 420.0})
    assert rates == {}
    with pytest.raises(UsageError, match=r"trim of 'de' is 0\.7 rad, expected -0\.5 to 0\.5"):
        effector_travel(VEHICLE, ("de",), {"de": 0.7})


def test_what_cannot_be_optimised_is_named(loop):
    shared = design(combs={"de": [3, 7], "da": [4, 8], "dr": [5, 7], "n1": [6, 9]})
    with pytest.raises(UsageError, match="'dr' and 'de' share harmonic 7"):
        optimal_amplitudes(shared, loop, SETTINGS, QUIET, {"de": 0.1})
    with pytest.raises(UsageError, match="wanted of 'qq' in 'X'"):
        optimal_amplitudes(design(), loop, SETTINGS, QUIET, *limits(), wanted={"X": {"qq": 1.0}})
    with pytest.raises(UsageError, match="'w' is allowed 0"):
        optimal_amplitudes(design(), loop, SETTINGS, QUIET, {"w": 0.0})
    with pytest.raises(UsageError, match="nothing limits 'de'"):
        optimal_amplitudes(design(), loop, SETTINGS, QUIET, {"da": 0.1, "dr": 0.1, "p": 1.0})

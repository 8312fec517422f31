"""Output error in time: recovery, sensitivities, several manoeuvres, choices, and what cannot be had."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter
from second_order import DT, MODEL, TRUTH, elevator, fly

from freqid.core.errors import DataError, UsageError
from freqid.identify.output_error.estimate import Settings, estimate
from freqid.identify.output_error.model import DynamicModel, Signals
from freqid.identify.output_error.parameters import Choices
from freqid.identify.output_error.simulation import compiled


def test_parameters_initial_states_and_biases_are_recovered_from_clean_signals():
    found = estimate(MODEL, [fly(bias=0.4)])
    assert found.converged
    for name, value in {**TRUTH, "x0_w": 0.3, "x0_q": -0.02, "bias_az": 0.4}.items():
        # the truth is exactly discretised, the model integrated by Runge-Kutta
        assert found[name][0] == pytest.approx(value, rel=2e-5, abs=1e-7)


def test_sensitivities_are_those_of_the_simulation():
    simulate, sensitivities = compiled(MODEL)
    vector = np.array([[*TRUTH.values(), 0.4, 0.3, -0.02]])
    u = elevator()[None, :, None]
    _, along = sensitivities(vector, u, DT)
    for i in range(vector.size):
        h = 1e-6 * max(abs(vector[0, i]), 0.1)
        up, down = vector.copy(), vector.copy()
        up[0, i] += h
        down[0, i] -= h
        slope = (np.asarray(simulate(up, u, DT)) - np.asarray(simulate(down, u, DT))) / (2 * h)
        np.testing.assert_allclose(np.asarray(along)[..., i], slope, rtol=1e-5, atol=1e-6)


def test_manoeuvres_of_different_lengths_share_dynamics_and_keep_their_own_biases():
    flights = [fly(1, noise=1.0, bias=0.4), fly(2, noise=1.0, samples=300, bias=-0.8, x0=(0.0, 0.0))]
    both, first = estimate(MODEL, flights), estimate(MODEL, flights[:1])
    for name, value in {**TRUTH, "bias_az@1": 0.4, "bias_az@2": -0.8}.items():
        estimate_, sigma = both[name]
        assert abs(estimate_ - value) < 4 * sigma
    shared = [n for n in both.names if n in TRUTH]
    assert all(both[n][1] < first[n][1] for n in shared)
    assert both.fit["w@2"].axis.size == 300


def test_parameters_are_fixed_and_tied():
    found = estimate(
        MODEL,
        [fly(3, noise=1.0), fly(4, noise=1.0)],
        Choices(fixed={"Zq": 28.0}, tied={"bias_az@2": "bias_az@1"}),
    )
    assert found["Zq"] == (28.0, 0.0)
    assert found.held["bias_az@2"] == pytest.approx(found["bias_az@1"][0])
    assert "bias_az@2" not in found.names


def test_a_tie_with_a_factor_is_held_while_estimating():
    truth = {**TRUTH, "Mq": 6 * TRUTH["Mw"]}
    found = estimate(MODEL, [fly(truth=truth)], Choices(tied={"Mq": ("Mw", 6.0)}))
    assert found["Mw"][0] == pytest.approx(truth["Mw"], rel=1e-4)
    assert found["Mq"][0] == pytest.approx(6 * found["Mw"][0])


def test_bounds_that_exclude_the_optimum_are_said_and_the_rest_is_estimated():
    found = estimate(MODEL, [fly(5, noise=1.0)], Choices(bounds={"Mq": (-1.0, -0.1)}))
    assert found.at_bound == ("Mq",)
    assert found["Mq"][0] == pytest.approx(-1.0)
    assert np.isnan(found["Mq"][1])
    assert found["Mde"][1] > 0
    assert any("'Mq' is outside its bounds -1 to -0.1" in remark for remark in found.remarks)


def test_bounds_that_hold_the_optimum_change_nothing():
    free, bounded = (
        estimate(MODEL, [fly(5, noise=1.0)], Choices(bounds=b)) for b in (None, {"Mq": (-4.0, -0.1)})
    )
    assert bounded["Mq"][0] == pytest.approx(free["Mq"][0], abs=0.02 * free["Mq"][1])


def test_a_parameter_that_is_not_excited_is_held_and_named():
    def with_flap(x, u, p):
        rates, outputs = MODEL.equations(x, u, p)
        return {**rates, "q": rates["q"] + p["Mdf"] * u["df"]}, outputs

    model = DynamicModel(
        "flap",
        MODEL.states,
        ("de", "df"),
        MODEL.outputs,
        (*MODEL.parameters, "Mdf"),
        with_flap,
        own=MODEL.own,
    )
    s = fly(6, noise=1.0)
    found = estimate(model, [Signals(s.dt, {**s.inputs, "df": 0.0}, s.outputs)])
    assert found.not_excited == {"Mdf": ()}
    assert found["Mdf"][1] == 0.0
    assert "the manoeuvres do not tell 'Mdf'; it is held at 0." in found.remarks
    assert found["Mde"][0] == pytest.approx(TRUTH["Mde"], abs=4 * found["Mde"][1])


def test_parameters_that_only_their_sum_is_known_of_are_named_together():
    def twice(x, u, p):
        rates, outputs = MODEL.equations(x, u, {**p, "Mde": p["Mde"] + p["Mtab"]})
        return rates, outputs

    model = DynamicModel(
        "tab", MODEL.states, ("de",), MODEL.outputs, (*MODEL.parameters, "Mtab"), twice, own=MODEL.own
    )
    found = estimate(model, [fly(6, noise=1.0)])
    ((held, others),) = found.not_excited.items()
    assert {held, *others} == {"Mde", "Mtab"}
    assert found["Mde"][0] + found["Mtab"][0] == pytest.approx(TRUTH["Mde"], abs=4 * found["Mde"][1] + 0.3)


def test_a_model_that_diverges_at_its_start_is_said_and_its_start_returned():
    start = {**TRUTH, "Zw": 60.0, "bias_az": 0.0}
    found = estimate(MODEL, [fly(samples=2000)], Choices(start=start))
    assert not found.converged
    assert not found.valid
    assert found["Zw"][0] == 60.0
    assert "diverges at its start" in found.remarks[0]


def test_an_unstable_aircraft_is_identified():
    truth = {**TRUTH, "Mw": 0.2}
    found = estimate(MODEL, [fly(7, noise=0.5, samples=150, truth=truth)])
    assert found.converged
    for name in truth:
        estimate_, sigma = found[name]
        assert abs(estimate_ - truth[name]) < 4 * sigma


def test_a_full_noise_covariance_is_worth_more_where_noise_is_common_to_outputs():
    clean, errors = fly(), {"full": [], "diagonal": []}
    for seed in range(12):
        rng = np.random.default_rng(seed)
        common = rng.normal(size=clean.samples)
        outputs = {
            "w": clean.outputs["w"] + 0.1 * common,
            "q": clean.outputs["q"] + 0.004 * rng.normal(size=clean.samples),
            "az": clean.outputs["az"] + 0.1 * common + 0.02 * rng.normal(size=clean.samples),
        }
        for noise, found in errors.items():
            result = estimate(MODEL, [Signals(DT, clean.inputs, outputs)], None, Settings(noise=noise))
            found.append((result["Zw"][0] - TRUTH["Zw"], result["Zw"][1]))
    scatter = {noise: np.std([e for e, _ in found]) for noise, found in errors.items()}
    claimed = {noise: np.mean([s for _, s in found]) for noise, found in errors.items()}
    assert scatter["full"] < 0.8 * scatter["diagonal"]
    assert 0.5 < claimed["full"] / scatter["full"] < 2.0


@pytest.mark.parametrize(
    ("choices", "words"),
    [
        (Choices(fixed={"Mqq": 1.0}), "fixed names 'Mqq'"),
        (Choices(start={"Mqq": 1.0}), "start names 'Mqq'"),
        (Choices(bounds={"Mq": (1.0, -1.0)}), "expected the lower one first"),
        (Choices(tied={"Mq": "Mx"}), "tied to 'Mx', which is not estimated"),
        (Choices(fixed=dict.fromkeys(MODEL.parameters, 0.0), initial="zero"), "no parameter is left"),
    ],
)
def test_choices_that_do_not_fit_are_refused(choices, words):
    with pytest.raises(UsageError, match=words):
        estimate(MODEL, [fly()], choices)


def test_signals_that_do_not_fit_are_refused():
    s = fly()
    broken = np.where(np.arange(s.samples) == 7, np.nan, s.outputs["q"])
    with pytest.raises(DataError, match="'q' is not finite in 1 of 400 samples, first at sample 7"):
        estimate(MODEL, [Signals(s.dt, s.inputs, {**s.outputs, "q": broken})])
    with pytest.raises(DataError, match="input 'de' is missing"):
        estimate(MODEL, [Signals(s.dt, {}, s.outputs)])
    with pytest.raises(UsageError, match="sampled at 25 Hz, 50 Hz"):
        estimate(MODEL, [s, Signals(0.02, s.inputs, s.outputs)])


def test_a_hidden_state_needs_starts():
    model = DynamicModel("hidden", MODEL.states, ("de",), ("az",), MODEL.parameters, _az_only, own=MODEL.own)
    s = fly()
    with pytest.raises(UsageError, match="states w q are not measured"):
        estimate(model, [Signals(s.dt, s.inputs, {"az": s.outputs["az"]})])
    start = {n: v * 1.2 for n, v in TRUTH.items()} | {"bias_az": 0.0}
    found = estimate(model, [Signals(s.dt, s.inputs, {"az": s.outputs["az"]})], Choices(start=start))
    # the accelerometer alone tells both poles and the gain; two parameters more it does not tell
    assert len(found.not_excited) == 2
    there, truth = found.values(), TRUTH
    for name, of in {
        "trace": lambda p: p["Zw"] + p["Mq"],
        "determinant": lambda p: p["Zw"] * p["Mq"] - p["Zq"] * p["Mw"],
        "gain": lambda p: p["Zw"] * p["Zq"] * p["Mde"],
    }.items():
        assert of(there) == pytest.approx(of(truth), rel=1e-4), name


def _az_only(x, u, p):
    rates, outputs = MODEL.equations(x, u, p)
    return rates, {"az": outputs["az"]}


def test_starts_are_those_of_equation_error():
    flight = fly(9, noise=1.0)
    found = estimate(MODEL, [flight])
    start = dict(zip(found.names, found.start, strict=True))
    rate = savgol_filter(flight.outputs["q"], 9, 4, deriv=1, delta=DT, mode="interp")
    columns = np.stack([flight.outputs["w"], flight.outputs["q"], flight.inputs["de"]], axis=1)
    expected = np.linalg.lstsq(columns, rate)[0]
    np.testing.assert_allclose([start[n] for n in ("Mw", "Mq", "Mde")], expected, rtol=1e-6)
    assert start["x0_w"] == flight.outputs["w"][0]


def test_nothing_excited_is_said():
    found = estimate(
        MODEL,
        [Signals(DT, {"de": 0.0}, dict.fromkeys(MODEL.outputs, np.zeros(100)))],
        Choices(fixed={"bias_az": 0.0}, initial="zero"),
    )
    assert not found.converged
    assert "no parameter is excited" in found.remarks[0]
    assert set(found.not_excited) == set(TRUTH)

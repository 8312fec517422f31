"""Sealed predictions of a linear aircraft that is flown by integration, and what is said of other flights."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import msgspec
import numpy as np
import pytest

import freqid as fq
from freqid.core import store
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.core.results.prediction import FILE, QUANTILE, SCORE_FILE, ChannelScore
from freqid.design.multisine.orthogonal_set import sampled
from freqid.workflows.models.seal import predict_flight, score_prediction

DATE = datetime(2026, 5, 4, 9, 30, tzinfo=UTC)
DT = 0.02
DRAWS = 25
UNITS = {"u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "q": "rad/s", "r": "rad/s"}
UNITS |= {"phi": "rad", "theta": "rad", "psi": "rad", "ax": "m/s2", "ay": "m/s2", "az": "m/s2"}


@pytest.fixture(scope="session")
def scenario(linear_aircraft):
    project = linear_aircraft.__file__.rpartition("/examples/")[0]
    described = fq.read_scenario(f"{project}/scenarios/linear.toml")
    # without a simulation: the law is [control.gains], and actuators follow at once, as they do in `fly`
    described = msgspec.structs.replace(described, simulation=type(described.simulation)())
    noise = {**described.noise, "phi": 0.0017, "theta": 0.0017}
    assert described.excitation is not None
    excitation = msgspec.structs.replace(described.excitation, period_s=30.0, periods=2)
    return msgspec.structs.replace(described, noise=noise, excitation=excitation)


@pytest.fixture(scope="session")
def designs(scenario):
    return [fq.design_inputs(scenario, seed=seed).design for seed in (0, 1)]


@pytest.fixture(scope="session")
def fly(linear_aircraft, scenario):
    """Fly the linear aircraft of the examples, nonlinear rigid body and all, with a design of ours."""
    module = linear_aircraft

    def call(design, seed, *, loads=None, scale=1.0, noise=1.0, gust=0.0, limit=np.inf, trim=0.0):
        inputs = sampled(design)
        derivatives = loads or module.DERIVATIVES
        rng = np.random.default_rng(seed)
        time = np.arange(0.0, inputs.time[-1] + DT / 2, DT)
        drive = {
            n: scale * np.interp(time, inputs.time, row)
            for n, row in zip(inputs.names, inputs.values, strict=True)
        }
        pushed = gust * np.cumsum(rng.standard_normal((time.size, 6)) * np.sqrt(DT), axis=0)
        pushed -= np.linspace(0, 1, time.size)[:, None] * pushed[-1]
        size = np.array([28.6, 28.6, 28.6, 2.4, 3.1, 4.9])
        state = np.array([20.0 + trim, 0, 0, 0, 0, 0, 0, 0, 0], dtype=float)
        rows, effectors = [], []

        def positions(x, k):
            moved = dict(module.TRIM)
            gains = scenario.control["gains"]
            known = dict(zip(module.STATES, x, strict=True))
            for name in moved:
                moved[name] += drive[name][k] + sum(g * known[s] for s, g in gains.get(name, {}).items())
            moved["de"] = float(np.clip(moved["de"], -limit, limit))
            return moved

        def rate(x, k):
            applied = module.wrench(x, positions(x, k), derivatives) + size * pushed[k]
            return module.motion(x, applied), applied

        forces = []
        for k in range(time.size):
            rows.append(state)
            effectors.append(positions(state, k))
            first, applied = rate(state, k)
            forces.append(applied)
            later = min(k + 1, time.size - 1)
            middle = 0.5 * (rate(state + DT / 2 * first, k)[0] + rate(state + DT / 2 * first, later)[0])
            state = state + DT * middle
        states, applied = np.array(rows).T, np.array(forces).T
        values = {f"state/{n}": row for n, row in zip(module.STATES, states, strict=True)}
        values |= {f"state/{n}": applied[i] / 28.6 for i, n in enumerate(("ax", "ay", "az"))}
        values |= {f"effector/{n}": np.array([e[n] for e in effectors]) for n in effectors[0]}
        channels = {}
        for name, row in values.items():
            short = name.partition("/")[2]
            kind = "rotor" if short == "n1" else "surface"
            sigma = scenario.noise.get(short, scenario.noise[kind] if name.startswith("effector") else 0.0)
            unit = UNITS.get(short, "rad/s" if short == "n1" else "rad")
            noisy = row + noise * sigma * rng.standard_normal(row.size)
            channels[name] = Channel(name, unit, noisy, 1 / DT, "flown")
        for name, row in drive.items():
            unit = "rad/s" if name == "n1" else "rad"
            channels[f"excitation/{name}"] = Channel(f"excitation/{name}", unit, row, 1 / DT, "flown")
        channels["air/rho"] = Channel("air/rho", "kg/m3", np.full(time.size, 1.225), 1 / DT, "flown")
        return FlightRecord(time, channels, vehicle=scenario.aircraft(), reference="u20")

    return call


@pytest.fixture(scope="session")
def model(fly, designs, scenario):
    return fq.identify_point(fly(designs[0], 7), scenario, estimator="instruments")


@pytest.fixture(scope="session")
def prediction(model, designs, scenario):
    return predict_flight(model, designs[1], scenario, date=DATE, draws=DRAWS)


@pytest.fixture(scope="session")
def flight(fly, designs):
    return fly(designs[1], 11)


def test_a_flight_as_predicted_stays_in_the_bands(prediction, flight):
    score = score_prediction(prediction, flight)
    assert score.passed
    assert score.failed == ()
    assert 0.90 < score.coverage["free-run"] < 0.99
    assert 0.92 < score.coverage["one-step"] < 0.98
    # the motion is predicted, not only covered
    assert score["free-run/q"].theil < 0.08
    assert score["free-run/phi"].theil < 0.12
    for name in ("p", "q", "r", "theta", "de"):
        channel = score[f"free-run/{name}"]
        assert 0.5 < channel.rmse / channel.expected_rmse < 1.6


def test_bands_hold_what_they_are_said_to_hold(prediction, model, designs, scenario):
    channel = prediction["u"]
    assert channel.noise_std == 0.15
    np.testing.assert_allclose(channel.upper - channel.change, QUANTILE * channel.std)
    # a covariance four times as large doubles what the parameters add
    wider = replace(
        model, responses={n: replace(r, covariance=4 * r.covariance) for n, r in model.responses.items()}
    )
    found = predict_flight(wider, designs[1], scenario, date=DATE, draws=DRAWS)
    ratio = np.sqrt(np.mean(found["q"].parameter_std ** 2) / np.mean(prediction["q"].parameter_std ** 2))
    assert 1.8 < ratio < 2.3
    # stated gusts widen, and by about their own size in a velocity that is relative to the air
    gusty = predict_flight(model, designs[1], scenario, date=DATE, draws=2, turbulence=5.0)
    assert 0.1 < gusty["w"].gust_std < 1.2
    assert prediction["w"].gust_std == 0.0


def test_the_same_seed_and_date_give_the_same_seal(prediction, model, designs, scenario, tmp_path):
    again = predict_flight(model, designs[1], scenario, date=DATE, draws=DRAWS)
    assert again.checksum == prediction.checksum
    other = predict_flight(model, designs[1], scenario, date=DATE, draws=2, seed=1)
    assert other["q"].parameter_std[500] != again["q"].parameter_std[500]
    fq.save(prediction, tmp_path / "p.h5")
    read = fq.read(tmp_path / "p.h5")
    assert read.checksum == prediction.checksum
    assert read.design.names == designs[1].names
    assert list(read.to_frame().columns[:3]) == ["u (m/s)", "u lower", "u upper"]


def edit_history(file):
    file["channel/q/change"][5] += 1e-9


def edit_band(file):
    file["channel/q"].attrs["residual_std"] *= 2


def edit_date(file):
    file.attrs["date"] = "2020-01-01T00:00:00+00:00"


def edit_assumption(file):
    file["assumption/amplitude"].attrs["limit"] = 99.0


def edit_parameter(file):
    file["parameter/M/de/estimate"][...] *= 1.0001


def edit_design(file):
    file["design/excitation/de"][100] = 0.0


@pytest.mark.parametrize(
    "edit", [edit_history, edit_band, edit_date, edit_assumption, edit_parameter, edit_design]
)
def test_an_edited_prediction_is_refused(edit, prediction, flight, tmp_path):
    path = tmp_path / "p.h5"
    FILE.write(path, prediction)
    with store.editing(path) as file:
        edit(file)
    with pytest.raises(DataError, match="edited after it was sealed"):
        score_prediction(path, flight)


def test_what_was_not_sealed_is_refused(prediction, flight):
    with pytest.raises(DataError, match="edited after it was sealed"):
        score_prediction(replace(prediction, vehicle="another"), flight)


def test_a_record_of_another_design_is_refused(prediction, fly, designs):
    with pytest.raises(DataError, match=r"no flight of the design 'design': \d of 4 injections"):
        score_prediction(prediction, fly(designs[0], 3))


def test_a_flight_before_its_prediction_is_refused(prediction, flight):
    early = replace(flight, provenance={"flown_utc": "2026-05-04T09:29:59+00:00"})
    with pytest.raises(DataError, match="before the prediction was sealed"):
        score_prediction(prediction, early)
    later = replace(flight, provenance={"flown_utc": "2026-05-04T11:30:00+01:00"})
    assert score_prediction(prediction, later).flown == "2026-05-04T10:30:00+00:00"
    with pytest.raises(DataError, match="expected a date"):
        score_prediction(prediction, replace(flight, provenance={"flown_utc": "last Monday"}))


CHANGED = {
    "structure": {"loads": {"M": {"u": 0.4, "w": -9.0, "q": -18.0, "de": -30.0, "n1": 0.05}}},
    "excitation": {"scale": 1.25},
    "amplitude": {"scale": 2.0},
    "noise": {"noise": 2.0},
    "disturbances": {"gust": 0.4},
    "limits": {"limit": 0.05},
}


@pytest.mark.parametrize("name", CHANGED)
def test_the_assumption_that_failed_is_named(name, prediction, fly, designs, linear_aircraft):
    changed = dict(CHANGED[name])
    if "loads" in changed:
        changed["loads"] = linear_aircraft.DERIVATIVES | changed["loads"]
    record = fly(designs[1], 13, **changed)
    if name == "limits":  # the stop that it meets is stated
        stopped = [
            msgspec.structs.replace(e, limits=(-0.05, 0.05)) if e.name == "de" else e
            for e in record.vehicle.effectors
        ]
        record = replace(record, vehicle=msgspec.structs.replace(record.vehicle, effectors=tuple(stopped)))
    score = score_prediction(prediction, record)
    assert name in score.failed
    evidence = {c.name: c.evidence for c in score.checks}[name]
    assert any(character.isdigit() for character in evidence)


def test_trim_and_density_are_held_against_the_condition(prediction, flight):
    moved = dict(flight.channels)
    moved["air/rho"] = replace(moved["air/rho"], values=moved["air/rho"].values * 0.9)
    moved["state/u"] = replace(moved["state/u"], values=moved["state/u"].values + 2.0)
    score = score_prediction(prediction, replace(flight, channels=moved))
    assert {"trim", "density"} <= set(score.failed)
    u = score["free-run/u"]
    assert u.offset == pytest.approx(2.0, abs=0.3)
    assert u.bias_share > 0.9


def test_theil_and_its_shares_are_what_their_definition_says():
    rng = np.random.default_rng(0)
    a, p = rng.standard_normal((2, 400))
    a, p = a - a.mean(), 0.4 * a + 0.3 * (p - p.mean())
    a = a - a.mean()
    p = p - p.mean()
    shift = 0.2
    score = ChannelScore("free-run", "q", "rad/s", np.arange(400.0), a, p, np.ones(400), shift, 0.0)
    error = np.mean((a + shift - p) ** 2)
    bias, variance, covariance = score.shares
    assert sum(score.shares) == pytest.approx(1.0)
    assert bias * error == pytest.approx(shift**2)
    assert variance * error == pytest.approx((a.std() - p.std()) ** 2)
    assert covariance * error == pytest.approx(2 * (1 - np.corrcoef(a, p)[0, 1]) * a.std() * p.std())
    sizes = np.sqrt(np.mean((a + shift) ** 2)) + np.sqrt(np.mean(p**2))
    assert score.theil == pytest.approx(np.sqrt(error) / sizes)
    assert score.coverage == np.mean(np.abs(a - p) <= QUANTILE)


def test_a_score_is_read_as_it_was_written(prediction, flight, tmp_path):
    score = score_prediction(prediction, flight)
    SCORE_FILE.write(tmp_path / "s.h5", score)
    read = fq.read(tmp_path / "s.h5")
    assert read.coverage == score.coverage
    assert read.checks == score.checks
    assert read.to_frame().shape == (24, 12)


def test_an_unstable_free_run_is_one_sentence(model, designs, scenario):
    diverging = {n: replace(r, estimate=r.estimate.copy()) for n, r in model.responses.items()}
    diverging["M"].estimate[list(model["M"].regressors).index("w")] = 30.0
    with pytest.raises(UsageError, match=r"free-running response is unstable: .* doubles in 0\.\d+ s"):
        predict_flight(replace(model, responses=diverging), designs[1], scenario)


def test_bad_input_is_one_sentence(model, designs, scenario):
    bare = {n: replace(r, covariance=np.zeros_like(r.covariance)) for n, r in model.responses.items()}
    with pytest.raises(DataError, match="'X' has no covariance"):
        predict_flight(replace(model, responses=bare), designs[1], scenario)
    other = replace(
        designs[1], signals=(replace(designs[1].signals[0], name="canard"), *designs[1].signals[1:])
    )
    with pytest.raises(UsageError, match="excites 'canard', which vehicle 'Linear aircraft' does not have"):
        predict_flight(model, other, scenario)
    few = {n: model.responses[n] for n in "XZM"}
    with pytest.raises(UsageError, match="no Y L N"):
        predict_flight(replace(model, responses=few), designs[1], scenario)
    with pytest.raises(UsageError, match="is of 'u20', and is asked to predict at 'u30'"):
        predict_flight(model, designs[1], scenario, at="u30")
    with pytest.raises(UsageError, match="gate is 95"):
        score_prediction("none.h5", "none.h5", gate=95)


def test_least_squares_in_noise_are_warned_of(fly, designs, scenario):
    biased = fq.identify_point(fly(designs[0], 7), scenario, estimator="least-squares")
    found = predict_flight(biased, designs[1], scenario, date=DATE, draws=2)
    assert "least squares" in found.remarks[0]


def test_a_model_that_was_identified_in_time_is_sealed_read_and_scored(fly, designs, scenario, tmp_path):
    """It keeps no lines; the wrench in free run is compared as far as its bands hold noise."""
    made = fq.identify_point(fly(designs[0], 7, noise=0.0), scenario, method="time")
    # sensors whose noise is far above what is not linear, which bands without a residual do not hold
    loud = msgspec.structs.replace(scenario, noise={n: 10 * x for n, x in scenario.noise.items()})
    sealed = predict_flight(made, designs[1], loud, date=DATE, draws=5)
    assert not sealed.responses[0].residual.size
    fq.save(sealed, tmp_path / "p.h5")  # empty arrays are no edit
    score = score_prediction(tmp_path / "p.h5", fly(designs[1], 11, noise=10.0))
    for response in "XYZLMN":
        channel = score[f"free-run/{response}"]
        assert 0.6 < channel.rmse / channel.expected_rmse < 1.4, response


def test_effectors_that_the_law_moves_and_the_model_does_not_know_are_told(model, designs, scenario):
    without = {
        n: replace(
            r,
            **{
                name: getattr(r, name)[np.array(r.regressors) != "dr"]
                for name in ("trim", "regressor_rms", "estimate", "std_error")
            },
            covariance=r.covariance[np.ix_(*[np.array(r.regressors) != "dr"] * 2)],
            regressors=tuple(x for x in r.regressors if x != "dr"),
            regressor_units=tuple(
                u for x, u in zip(r.regressors, r.regressor_units, strict=True) if x != "dr"
            ),
        )
        for n, r in model.responses.items()
    }
    gains = {**scenario.control["gains"], "dr": {"r": 0.1}}
    moved = msgspec.structs.replace(scenario, control={**scenario.control, "gains": gains})
    found = predict_flight(replace(model, responses=without), designs[1], moved, date=DATE, draws=2)
    assert any("the law moves dr, of which the model has no derivatives" in r for r in found.remarks)

"""Least squares without the bias by noise in the regressors, beside the law that the bias follows."""

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.identify.model.fit import fit_lines
from freqid.identify.model.line_equations import on_lines
from freqid.identify.model.noise_bias import without_noise_bias
from freqid.identify.model.problem import Problem

DT, TRUE = 0.02, np.array([-9.0, -42.0])
NOISE = np.array([0.45, 0.018])  # of w and de, half of what they move by
LINES = np.arange(3, 41) / 20.0
VEHICLE = Vehicle(
    name="made",
    mass_properties=MassProperties(1.0, Inertia(1.0, 1.0, 1.0)),
    effectors=(Effector("de", "surface", (-1.0, 1.0)),),
)
SETTINGS = Identification(
    responses=("M",),
    regressors=("w", "de"),
    response_source="record",
    frequencies_hz=tuple(LINES),
    residuals="white",
)


def flown(seed: int, seconds: float) -> Maneuver:
    """Return a moment that is exactly linear in two correlated motions, which are measured with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds / DT)) * DT
    phase = rng.uniform(0, 2 * np.pi, (2, LINES.size, 1))
    w, de = np.sin(2 * np.pi * LINES[:, None] * t + phase).sum(axis=1) * np.array([[0.1], [0.005]])
    w = w + 10 * de
    moment = TRUE @ [w, de] + 0.2 * rng.standard_normal(t.size)
    rows = {"state/w": w + NOISE[0] * rng.standard_normal(t.size)}
    rows |= {"effector/de": de + NOISE[1] * rng.standard_normal(t.size), "response/M": moment}
    units = {"state/w": "m/s", "effector/de": "rad", "response/M": "N m"}
    channels = {n: Channel(n, units[n], x, 1 / DT, "made") for n, x in rows.items()}
    return Maneuver(FlightRecord(t, channels), VEHICLE)


@pytest.fixture(scope="module")
def estimates():
    """By least squares and without the bias, with half widths, over 40 pairs of flights of two lengths."""
    rows = []
    for seed in range(40):
        maneuvers = [flown(2 * seed, 20.0), flown(2 * seed + 1, 40.0)]
        problem = Problem.of(maneuvers, SETTINGS)
        equations = on_lines(problem.x, problem.wrench, problem.dt, LINES)
        fit = fit_lines(problem, LINES)["M"]
        freed = without_noise_bias(problem, equations, fit)
        rows.append([fit.estimate, freed.estimate, (freed.upper - freed.lower) / 2, freed.std_error])
    return np.array(rows)


def test_the_bias_is_gone_and_the_errors_hold(estimates):
    plain, freed = estimates[:, 0], estimates[:, 1]
    scatter = freed.std(axis=0) / np.sqrt(len(freed))
    assert (np.abs(plain.mean(axis=0) - TRUE) > 4.5 * scatter).all()
    assert (np.abs(freed.mean(axis=0) - TRUE) < 3.5 * scatter).all()
    held = np.abs(freed - TRUE) < estimates[:, 2]
    assert 0.88 < held.mean() <= 1.0
    np.testing.assert_allclose(estimates[:, 3].mean(axis=0), freed.std(axis=0), rtol=0.3)


def test_what_is_taken_off_is_the_bias_of_the_law(estimates):
    """A closed form: white noise of each regressor has the power sigma^2 T dt on every line."""
    power = np.zeros((2, 2))
    for seed, seconds, weight in ((0, 20.0, 1.0), (1, 40.0, 0.5)):
        record = flown(seed, seconds).record
        t = record.time
        rows = record.matrix(("state/w", "effector/de"))
        lines = DT * np.exp(-2j * np.pi * LINES[:, None] * t) @ (rows - rows.mean(axis=1, keepdims=True)).T
        power += weight * (lines.conj().T @ lines).real
    noise = np.diag(NOISE**2) * DT * LINES.size * (20.0 + 0.5 * 40.0)
    expected = np.linalg.solve(power - noise, power)
    plain, freed = estimates[0, :2]
    # Noise is estimated to some per cent, and end terms take a few equations.
    np.testing.assert_allclose(freed - plain, (expected - np.eye(2)) @ plain, rtol=0.15)


def test_noise_that_is_all_of_a_regressor_does_not_blow_up():
    maneuver = flown(0, 20.0)
    channel = maneuver.record.channel("effector/de")
    noise = 0.004 * np.random.default_rng(9).standard_normal(channel.values.size)
    changed = {**maneuver.record.channels, "effector/de": Channel("effector/de", "rad", noise, 50.0, "made")}
    alone = Maneuver(FlightRecord(maneuver.record.time, changed), VEHICLE)
    problem = Problem.of([alone], SETTINGS)
    fit = fit_lines(problem, LINES)["M"]
    freed = without_noise_bias(problem, on_lines(problem.x, problem.wrench, problem.dt, LINES), fit)
    assert (np.abs(freed.estimate) < 2.5 * np.abs(fit.estimate).max()).all()
    assert (freed.std_error <= 2.5 * fit.std_error.max()).all()

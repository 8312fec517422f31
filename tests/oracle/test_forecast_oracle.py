"""Forecast standard errors against the scatter of estimates from flights with simulated sensor noise.

The flight is a time history: Runge-Kutta steps of an aircraft written down here from the nonlinear
equations of motion and linearised by differences, from rest, so with its transient. It shares no code
with the forecast. Rotor inertia, lags and accelerometers off the centre of gravity are all in it.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from freqid.core.record import Maneuver
from freqid.core.results.design import Multisine, MultisineDesign
from freqid.core.scenario import read_scenario
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.design.forecast.standard_errors import forecast
from freqid.flightlog.read import read_log
from freqid.identify.point import identify_point
from freqid.identify.regress.regression import least_squares
from freqid.identify.spectra.fourier import FourierPlan, harmonics

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
PERIOD, PERIODS, DT, BAND = 60.0, 2, 0.02, (0.05, 1.8)
SEEDS = 500
EFFECTORS = ("de", "da", "dr", "n1")
TRIM = np.array([0.02, 0.0, 0.0, 420.0])
LAG = np.array([0.06, 0.04, 0.05, 0.1])
ROTOR_INERTIA = 0.005
ARM = np.array([0.12, 0.02, -0.05])
GAINS = {"de": {"theta": 0.35, "q": 0.05}, "da": {"phi": -0.3, "p": -0.05}, "dr": {"r": 0.1}}
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")
CHANNELS = (*STATES, *EFFECTORS, "ax", "ay", "az")


def design_of(aircraft, seed, periods):
    """Return the multisines that the example flies with a seed."""
    rng = np.random.default_rng(seed)
    signals = []
    for i, name in enumerate(EFFECTORS):
        index = np.arange(3, 109)[i :: len(EFFECTORS)]
        amplitude = np.full(index.size, aircraft.EFFECTORS[name] * np.sqrt(2 / index.size))
        phase = rng.uniform(0, 2 * np.pi, index.size)
        signals.append(Multisine(name, "rad/s" if name == "n1" else "rad", index, amplitude, phase))
    return MultisineDesign(tuple(signals), PERIOD, periods, BAND, DT, seed)


@pytest.fixture(scope="module")
def design(linear_aircraft):
    return design_of(linear_aircraft, seed=3, periods=PERIODS)


@pytest.fixture(scope="module")
def sigma(linear_aircraft):
    level = linear_aircraft.NOISE
    return np.repeat(
        [level[k] for k in ("velocity", "rate", "angle", "surface", "rotor", "force")], [3, 3, 2, 3, 1, 3]
    )


@pytest.fixture(scope="module")
def predicted(linear_aircraft, design, sigma):
    scenario = read_scenario(SCENARIOS / "linear.toml")[0]
    vehicle = scenario.aircraft()
    rotor = msgspec.structs.replace(vehicle.rotors[0], inertia=ROTOR_INERTIA)
    loop = perturbed_aircraft(
        linear_aircraft.DERIVATIVES,
        msgspec.structs.replace(vehicle, rotors=(rotor,)),
        u=20.0,
        gains=GAINS,
        lag_s=dict(zip(EFFECTORS, LAG, strict=True)),
        trim=dict(zip(EFFECTORS, TRIM, strict=True)),
    )
    noise = dict(zip(CHANNELS, sigma, strict=True))
    return forecast(design, loop, scenario.identification, noise, accelerometer_m=tuple(ARM))


@pytest.fixture(scope="module")
def flown(linear_aircraft, design):
    """Channels without noise, shape (15, sample), perturbations about the trim."""
    inertia = inertia_matrix(linear_aircraft)

    def slope(x, excitation):
        """Nonlinear equations of motion; x is u v w p q r phi theta and effector positions."""
        v, w, (phi, theta), position = x[:3], x[3:6], x[6:8], x[8:]
        applied = linear_aircraft.wrench([*x[:8], 0.0], dict(zip(EFFECTORS, position, strict=True)))
        command = TRIM + excitation
        for i, name in enumerate(EFFECTORS):
            command[i] += sum(k * x[STATES.index(n)] for n, k in GAINS.get(name, {}).items())
        position_rate = (command - position) / LAG
        down = np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
        shaft = np.array([ROTOR_INERTIA, 0.0, 0.0])
        moment = applied[3:] - np.cross(w, inertia @ w + shaft * position[3]) - shaft * position_rate[3]
        return np.concatenate(
            [
                applied[:3] / linear_aircraft.MASS + linear_aircraft.GRAVITY * down - np.cross(w, v),
                np.linalg.solve(inertia, moment),
                [w[0] + (w[1] * np.sin(phi) + w[2] * np.cos(phi)) * np.tan(theta)],
                [w[1] * np.cos(phi) - w[2] * np.sin(phi)],
                position_rate,
            ]
        )

    trim = np.concatenate([[20.0], np.zeros(7), TRIM])
    a = differences(lambda x: slope(x, np.zeros(4)), trim)
    b = differences(lambda e: slope(trim, e), np.zeros(4))

    h, steps = DT / 2, round(PERIOD * PERIODS / DT) * 2
    half_steps = np.arange(2 * steps + 1) * h / 2
    excitation = np.array(
        [s.amplitude @ np.sin(2 * np.pi / PERIOD * np.outer(s.index, half_steps) + s.phase[:, None])
         for s in design.signals]
    )  # fmt: skip
    drive = (b @ excitation).T
    x, history = np.zeros(12), np.empty((12, steps + 1))
    for i in range(steps):
        history[:, i] = x
        k1 = a @ x + drive[2 * i]
        k2 = a @ (x + h / 2 * k1) + drive[2 * i + 1]
        k3 = a @ (x + h / 2 * k2) + drive[2 * i + 1]
        k4 = a @ (x + h * k3) + drive[2 * i + 2]
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    history[:, -1] = x
    history, drive = history[:, ::2], drive[::4].T

    derivatives = linear_aircraft.DERIVATIVES
    names = (*STATES, *EFFECTORS)
    force = np.array([[derivatives[r].get(n, 0.0) for n in names] for r in "XYZ"]) @ history
    turning = (a @ history + drive)[3:6]
    specific_force = force / linear_aircraft.MASS + np.cross(turning, ARM, axisb=0, axisa=0, axisc=0)
    return np.concatenate([history, specific_force])


@pytest.fixture(scope="module")
def estimates(linear_aircraft, predicted, flown, sigma):
    """Least-squares estimates by response, each of shape (seed, parameter)."""
    plan = FourierPlan(flown.shape[1], DT, harmonics(PERIOD, BAND))
    nuisance = np.concatenate([plan.nuisance(), 1j / plan.frequencies_hz[None]])
    moved = [CHANNELS.index(n) for n in ("p", "q", "r", "n1")]  # what has to be differentiated
    clean, clean_rate = plan(flown), plan.derivative(flown[moved])
    inertia, mass = inertia_matrix(linear_aircraft), linear_aircraft.MASS
    found = {r: [] for r in predicted.responses}
    for seed in range(SEEDS):
        noise = sigma[:, None] * np.random.default_rng(seed).standard_normal(flown.shape)
        x = clean + plan(noise)
        rate = clean_rate + plan.derivative(noise[moved])
        force = mass * (x[12:] - np.cross(rate[:3], ARM, axisa=0, axisb=0, axisc=0))
        momentum = np.array([ROTOR_INERTIA * TRIM[3], 0.0, 0.0])
        moment = inertia @ rate[:3] + np.cross(x[3:6], momentum, axisa=0, axisb=0, axisc=0)
        moment[0] += ROTOR_INERTIA * rate[3]
        for name, z in zip("XYZLMN", (*force, *moment), strict=True):
            rows = [CHANNELS.index(n) for n in predicted[name].regressors]
            found[name].append(least_squares(x[rows], z[None], nuisance=nuisance).estimate[0])
    return {name: np.array(rows) for name, rows in found.items()}


def inertia_matrix(aircraft):
    ix, iy, iz, ixz = aircraft.INERTIA
    return np.array([[ix, 0.0, -ixz], [0.0, iy, 0.0], [-ixz, 0.0, iz]])


def differences(function, at, h=1e-5):
    return np.array([(function(at + h * d) - function(at - h * d)) / (2 * h) for d in np.eye(at.size)]).T


def test_standard_errors_are_the_scatter_of_estimates(predicted, estimates):
    ratio = np.concatenate(
        [predicted[r].std_error / found.std(axis=0, ddof=1) for r, found in estimates.items()]
    )
    assert ratio.size == 30
    assert ratio.min() > 0.85
    assert ratio.max() < 1.15
    # A scatter from 500 flights is uncertain by 3.2 %, the mean over 30 parameters by far less.
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.03)


def test_biases_are_those_of_the_mean_estimate(linear_aircraft, predicted, estimates):
    largest = 0.0
    for name, found in estimates.items():
        forecast = predicted[name]
        truth = np.array([linear_aircraft.DERIVATIVES[name][n] for n in forecast.regressors])
        np.testing.assert_allclose(forecast.parameter, truth, rtol=1e-9)
        bias = found.mean(axis=0) - truth
        # The mean's own uncertainty, and a tenth of the bias for the transient that is not forecast.
        margin = 4 * forecast.std_error / np.sqrt(SEEDS) + 0.1 * np.abs(bias)
        assert (np.abs(forecast.bias - bias) < margin).all(), name
        largest = max(largest, float(np.abs(forecast.bias / forecast.std_error).max()))
    assert largest > 1.5  # otherwise there is nothing to forecast here


def test_correlations_are_those_of_estimates(predicted, estimates):
    for name, found in estimates.items():
        np.testing.assert_allclose(predicted[name].correlation, np.corrcoef(found.T), atol=0.15)


def test_an_identified_flight_states_what_was_forecast(linear_aircraft, linear_logs, sigma):
    """The example's own nonlinear flight, its log and the whole of identify-point."""
    scenario = read_scenario(SCENARIOS / "linear.toml")[0]
    vehicle = scenario.aircraft()
    log = read_log(linear_logs["noisy"], SCENARIOS / "maps" / "linear.toml", vehicle=vehicle)
    model = identify_point(Maneuver.of(log), scenario.identification, excitation=scenario.excitation)
    gains = {"de": {"theta": 0.35, "q": 0.05}, "da": {"phi": -0.3, "p": -0.05}}
    loop = perturbed_aircraft(linear_aircraft.DERIVATIVES, vehicle, u=20.0, gains=gains)
    noise = dict(zip(CHANNELS, sigma, strict=True))
    design = design_of(linear_aircraft, seed=1, periods=1)
    sensor = tuple(linear_aircraft.SENSOR)
    made = forecast(design, loop, scenario.identification, noise, accelerometer_m=sensor)
    ratio = np.concatenate([made[r].std_error / model[r].std_error for r in "XYZLMN"])
    # One flight judges its own noise from some 200 equations, in places from a few tens.
    assert np.abs(np.log(ratio)).max() < np.log(4 / 3)
    assert np.exp(np.log(ratio).mean()) == pytest.approx(1.0, abs=0.1)

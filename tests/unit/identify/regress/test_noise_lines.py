"""Lines between the harmonics: where they lie, what they tell of noise, and what they do not hear."""

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.identify.point import identify_point
from freqid.identify.regress.noise_lines import Noise, correct_by_noise_lines, noise_lines, noise_power
from freqid.identify.regress.regression import least_squares

HARMONICS = np.arange(3, 109) / 60.0
AIRCRAFT = Vehicle(
    name="Two effectors",
    mass_properties=MassProperties(mass_kg=10.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.5)),
    effectors=tuple(Effector(name=n, kind="surface", limits=(-0.5, 0.5)) for n in "ab"),
)


def test_noise_lines_are_between_the_harmonics_and_around_them():
    lines = noise_lines(HARMONICS, 60.0, 120.0)
    assert lines[0] == pytest.approx(2.5 / 60)
    assert lines[-1] > HARMONICS[-1]
    nearest = np.abs(lines[:, None] - np.arange(200) / 60.0).min(axis=1)
    assert np.allclose(nearest, 0.5 / 60)
    three = noise_lines(HARMONICS, 60.0, 180.0)
    assert np.all(np.abs(three[:, None] - np.arange(200) / 60.0).min(axis=1) > 0.3 / 60)


def test_a_record_of_less_than_two_periods_has_none():
    with pytest.raises(DataError, match=r"two periods of 60 s or more, the record lasts 100 s"):
        noise_lines(HARMONICS, 60.0, 100.0)


@pytest.mark.parametrize("harmonics", [[6], [6, 8, 9]])
def test_few_lines_are_enough(harmonics):
    hz = np.array(harmonics) / 60.0
    lines = noise_lines(hz, 60.0, 120.0)
    power = noise_power(hz, Noise(lines, np.full((1, lines.size), 3.0)))
    np.testing.assert_allclose(power, 3.0)


def _spectra(rng, power_of, size):
    power = power_of(size)
    return np.sqrt(power / 2) * (rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape))


def test_intervals_from_noise_lines_cover_and_ignore_what_repeats():
    """Noise whose power rises as f squared, and on the harmonics alone a distortion ten times as strong."""
    rng = np.random.default_rng(4)
    lines = noise_lines(HARMONICS, 60.0, 120.0)
    x = _spectra(rng, np.ones_like, np.zeros((6, HARMONICS.size)))
    true = np.array([[1.0, -2.0, 0.5, 3.0, 0.0, 1.5]])
    distorted = true @ x + 10 * _spectra(rng, lambda f: f**2, HARMONICS[None])
    kept = least_squares(x, distorted).estimate
    error, covered, naive, ratio = [], 0, 0, []
    for _ in range(300):
        z = distorted + _spectra(rng, lambda f: f**2, HARMONICS[None])
        fit = least_squares(x, z)
        noise = Noise(lines, np.abs(_spectra(rng, lambda f: f**2, lines[None])) ** 2)
        corrected = correct_by_noise_lines(fit, [HARMONICS], [noise])
        lower, upper = corrected.interval(0.95)
        covered += np.sum((lower < kept) & (kept < upper))
        lower, upper = fit.interval(0.95)
        naive += np.sum((lower < kept) & (kept < upper))
        error.append((corrected.estimate - kept) / corrected.std_error)
        alone = noise_power(HARMONICS, noise) * (1 - fit.leverage / 2)
        ratio.append(np.mean(np.abs(fit.residual) ** 2 / alone))
    assert covered / (300 * 6) == pytest.approx(0.95, abs=0.02)
    assert naive / (300 * 6) > 0.999  # the whole residual makes intervals ten times too wide
    assert np.sqrt(np.mean(np.square(error))) == pytest.approx(1.0, abs=0.05)
    assert np.mean(ratio) == pytest.approx(101, rel=0.3)  # amplitudes of 10 and 1 add in power


def _flight(rng, duration: float) -> Maneuver:
    """A response of 2 a - b to multisines of period 20 s, and noise as strong as they make it."""
    time = np.arange(round(duration / 0.05) + 1) * 0.05
    histories = {}
    for i, name in enumerate("ab"):
        lines, phases = np.arange(3 + i, 37, 2) / 20.0, rng.uniform(0, 6.28, 17)
        histories[f"effector/{name}"] = np.sin(2 * np.pi * np.outer(time, lines) + phases).sum(axis=1)
    noise = 12.0 * rng.standard_normal(time.size)
    histories["response/Y"] = 2 * histories["effector/a"] - histories["effector/b"] + noise
    channels = [Channel(n, "N" if n == "response/Y" else "1", v, 20.0, "made") for n, v in histories.items()]
    return Maneuver.of(FlightRecord(time, {c.name: c for c in channels}, vehicle=AIRCRAFT))


def test_a_response_that_is_linear_reaches_what_noise_allows_on_average():
    """The ceiling against R2 itself, and against the energies that went in: of one flight, and of two."""
    settings = Identification(
        responses=("Y",),
        regressors=("a", "b"),
        response_source="record",
        residuals="noise-lines",
        nuisance="none",
        trend="none",
    )
    excitation = Excitation(period_s=20.0, periods=4, band_hz=(0.15, 1.8))
    rng = np.random.default_rng(3)
    for durations in ((80.0,), (80.0, 60.0)):
        found = [
            identify_point([_flight(rng, t) for t in durations], settings, excitation=excitation)["Y"]
            for _ in range(60)
        ]
        short = np.array([f.r2 - f.r2_ceiling for f in found])
        assert abs(short.mean()) < 3 * short.std() / np.sqrt(60)
        assert short.std() < 0.05
        if len(durations) == 1:  # transforms: T / 2 of a unit sine, sigma^2 dt T of white noise
            signal, noise = 17 * (2.0**2 + 1) * (80.0 / 2) ** 2, 12.0**2 * 0.05 * 80.0
            allowed = 1 - (34 - 1) * noise / (signal + 34 * noise)  # two parameters take two of 68 equations
            assert np.mean([f.r2_ceiling for f in found]) == pytest.approx(allowed, abs=0.005)

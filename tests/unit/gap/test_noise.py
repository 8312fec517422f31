"""Noise: found in records, drawn, made white, told from turbulence; and what signatures share of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import DT, LIBRARY, SIGMA, SIZES, SLOPES, Linear, Truth, effect, fly
from scipy.signal import lfilter
from scipy.stats import chi2

from freqid.gap.compare import compare
from freqid.gap.noise import _RIDGE, HALF_WIDTH
from freqid.gap.quiet import noisy_channels, sensor_noise
from freqid.gap.residual import residual

BAND = (0.1, 2.0)
NULLS = 12


def compared(maneuver, library=None, count=80, seed=0):
    return compare(Linear(), maneuver, library or {}, SIZES, BAND, count=count, seed=seed)


@pytest.mark.parametrize("noise", [1.0, 4.0])
def test_noise_of_each_sensor_is_found(noise):
    record = fly(noise=noise, duration=60.0, seed=5).record
    found = sensor_noise(record, noisy_channels(record))
    assert set(found) == set(SIGMA)
    for name, sigma in found.items():
        # a white spectrum's level over 600 lines or more: twice as many real numbers, 4 of their sigma
        assert sigma == pytest.approx(noise * SIGMA[name], rel=4 / np.sqrt(2 * 1200)), name


def test_an_effector_logged_as_it_was_commanded_has_no_sensor():
    record = fly(noise=1.0, duration=20.0, seed=5).record
    surface = next(n for n in noisy_channels(record) if n.startswith("effector/"))
    sent = replace(record.channel(surface), name=surface.replace("effector/", "command/"))
    known = noisy_channels(record.with_channels(sent))
    assert known == [n for n in noisy_channels(record) if n != surface]
    other = replace(sent, values=np.roll(sent.values, 1))  # as commanded, a sample late: it was measured
    assert noisy_channels(record.with_channels(other)) == noisy_channels(record)


def test_noise_of_a_slow_sensor_is_that_of_its_samples():
    """Logged 20 times a second, joined by straight lines on a clock of 50: what lies between is no noise."""
    clean = fly(duration=60.0).record
    rng, time = np.random.default_rng(4), clean.time
    slow = np.arange(0, 60.0 + 1e-9, 1 / 20)
    theta = np.interp(slow, time, clean["state/theta"]) + 0.003 * rng.standard_normal(slow.size)
    joined = np.interp(time, slow, theta)
    channel = replace(clean.channel("state/theta"), values=joined, native_rate_hz=20.0)
    found = sensor_noise(clean.with_channels(channel), ["state/theta"])["state/theta"]
    # on a line in the band its samples weigh sigma^2 / 20 Hz, as white noise sqrt(50 / 20) as large at 50 Hz
    # 1200 samples, a degree of freedom each: 4 of the estimate's sigma
    assert found == pytest.approx(0.003 * np.sqrt(50 / 20), rel=4 / np.sqrt(2 * 1200))


@pytest.fixture(scope="module")
def nulls():
    return [
        compared(fly(noise=1.0, seed=s, duration=40.0, phases=1 + s % 4), LIBRARY, seed=s)
        for s in range(NULLS)
    ]


def kept_by_the_ridge(noise):
    """Return by row the variance that noise keeps in a metric that counts each row's variance once more."""
    variance = np.einsum("lii->li", noise.covariance).real * _RIDGE / (1 + _RIDGE)
    without = noise.covariance - variance[:, :, None] * np.eye(variance.shape[1])
    return np.einsum("lij,ljk,lik->li", noise.whitening, without, noise.whitening.conj()).real.mean(axis=0)


def test_noise_of_flights_is_as_strong_as_that_of_draws(nulls):
    energy = sum(float((c.white(c.residual) ** 2).sum()) for c in nulls)
    freedom = sum(2 * c.residual.size for c in nulls)
    drawn = np.mean([(c.white_draws**2).mean() for c in nulls])
    assert energy / freedom == pytest.approx(drawn, abs=4 * np.sqrt(2 / freedom))  # 4 sigma of chi-square


def test_draws_are_white_but_for_what_the_ridge_and_averaging_take(nulls):
    for c in nulls[:3]:
        rows, lines = c.residual.shape
        by_row = (c.white_draws**2).reshape(-1, rows, lines).mean(axis=(0, 2))
        kept = kept_by_the_ridge(c.noise)
        level = np.array([r.kind == "actuator" or r.name in "XZ" for r in c.rows])
        spread = 4 * np.sqrt(2 / (c.white_draws.size / rows))
        assert by_row[level] == pytest.approx(kept[level], rel=spread)  # no rate enters: alike on all lines
        # the rest is averaged over neighbours; were all rows rates of noise, whose power goes with f^2:
        near = np.abs(np.subtract.outer(np.arange(lines), np.arange(lines))) <= HALF_WIDTH
        power = c.lines.hz**2
        averaged = np.mean(power / (near @ power / near.sum(axis=1)))
        assert averaged * kept.mean() < by_row.mean() < 1 + spread / np.sqrt(rows)


def test_every_response_and_actuator_has_the_noise_that_is_said(nulls):
    rows = [r.name for r in nulls[0].rows if r.kind != "kinematic"]
    for i, name in enumerate(rows):
        said = np.array([c.noise.covariance[:, i, i].real for c in nulls])
        found = np.array([np.abs(c.residual[i]) ** 2 for c in nulls])
        energy = 2 * float((found / said).sum())
        freedom = 2 * found.size
        # trends and ends take up to six of each flight's real numbers
        assert chi2.ppf(1e-4, freedom - 6 * NULLS) < energy < chi2.isf(1e-4, freedom), name


def test_noise_is_that_of_the_formulas(nulls):
    """Force: mass times the accelerometer and slopes times states; moment: the derivative of momentum."""
    c = nulls[0]
    omega = 2 * np.pi * c.lines.hz
    s = {n.partition("/")[2]: x for n, x in SIGMA.items()}
    states = np.array([s["u"], s["w"], s["q"], s["d1"], s["d2"]])
    force = (10.0 * s["az"]) ** 2 + np.square(SLOPES[1] * states).sum()
    assert np.median(c.noise.covariance[:, 1, 1].real) == pytest.approx(DT * force, rel=0.1)
    moment = (2.0 * omega * s["q"]) ** 2 + np.square(SLOPES[2] * states).sum()
    inside = slice(12, -12)
    assert c.noise.covariance[inside, 2, 2].real == pytest.approx(DT * moment[inside], rel=0.2)


def test_turbulence_is_noise_that_is_stronger_than_the_sensors():
    """Loads that no motion and no control explains, coloured: the row's noise grows by them, smoothly."""
    rng = np.random.default_rng(8)
    maneuver = fly(noise=1.0, duration=60.0, seed=2)
    size = maneuver.record.time.size
    gust = lfilter([1 - 0.97], [1, -0.97], rng.standard_normal(size + 500))[500:]
    gust *= 0.3 / gust.std()  # m/s2
    calm = compared(maneuver)
    windy = fly(noise=1.0, duration=60.0, seed=2, add={"state/az": gust})
    rough = compared(windy)
    at = [r.name for r in calm.rows].index("Z")
    assert calm.noise.sensor_share[at].min() > 0.99
    low, high = (rough.lines.hz < 0.5), (rough.lines.hz > 1.5)
    level = np.abs(rough.lines.spectrum(10.0 * gust[None])[0]) ** 2  # ten times the mass is the force
    for part in (low, high):
        said = rough.noise.covariance[part, at, at].real
        assert said.mean() == pytest.approx(level[part].mean(), rel=0.3)
    assert rough.noise.sensor_share[at][low].mean() < rough.noise.sensor_share[at][high].mean()


@pytest.mark.parametrize(
    "truth", [Truth(loss=0.3), Truth(mass=11.0), Truth(drag=1.0), Truth(late=0.03)], ids=lambda t: str(t)[:24]
)
def test_a_gap_that_acts_through_the_motion_is_not_taken_for_noise(truth):
    found = compared(fly(truth, noise=1.0, duration=40.0, seed=3))
    assert found.noise.sensor_share.min() > 0.5
    assert (found.white(found.residual) ** 2).mean() > 3


SHARING = {
    # scale on what enters through the accelerometers, and on a channel that the simulation is fed with
    "heavy": LIBRARY["heavy"],
    "gyro": LIBRARY["gyro"],
    "drag": LIBRARY["drag"],
    "lift": effect(
        "lift", "factor", 0.1, replay=lambda s, r: s["factor"] * np.eye(6)[2][:, None] * r.record["state/w"]
    ),
}


@pytest.fixture(scope="module")
def shared():
    """Return, by effect, products of signature and residual over seeds, and what is said of their mean."""
    found = {name: ([], [], []) for name in SHARING}
    perfect = residual(Linear(), fly())  # what quadrature leaves, which is no noise
    for seed in range(60):
        c = compared(fly(noise=4.0, seed=100 + seed), SHARING, count=25, seed=seed)
        y = c.white(c.residual - c.lines.transform(perfect))
        for name in SHARING:
            column = next(n for n in c.signatures if n.startswith(f"{name}:"))
            z = c.signatures[column]
            product, said, sigma = found[name]
            x = c.white(z)
            product.append(float(x @ y))
            said.append(float(c.shared.attenuation(z[None], c.sources[column])[0]))
            sigma.append(float(np.linalg.norm(x)))
    return {name: tuple(np.array(x) for x in columns) for name, columns in found.items()}


@pytest.mark.parametrize("name", SHARING)
def test_what_signatures_share_of_the_noise_is_what_their_products_show(shared, name):
    product, said, sigma = shared[name]
    error = 3.3 * np.sqrt(np.mean(sigma**2) / product.size)
    assert abs(np.mean(product - said)) < error + 0.1 * abs(np.mean(said))
    assert np.std(product - said) == pytest.approx(np.sqrt(np.mean(sigma**2)), rel=0.3)

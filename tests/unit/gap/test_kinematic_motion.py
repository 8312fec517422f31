"""The body moves as a record tells of each line, where polynomials cannot follow; noise is not taken."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from linear_flight import SLOPES, Linear, Truth, fly, motion, vehicle

from freqid.core.record import Channel, FlightRecord
from freqid.gap.stack.block import flown_again, stack_of
from freqid.gap.stack.kinematic_motion import moved_as_recorded, noise_of
from freqid.gap.stack.lines import lines_of
from freqid.gap.stack.missed_motion import with_missed

G, DT, PERIOD, SECONDS, LEVER = 9.80665, 0.02, 40.0, 40.0, (0.3, -0.1, 0.05)
RATES, VELOCITY, FELT = (tuple(f"state/{n}" for n in names) for names in ("pqr", "uvw", ("ax", "ay", "az")))
SIGMA = dict.fromkeys(RATES, 0.002) | dict.fromkeys(VELOCITY, 0.03) | dict.fromkeys(FELT, 0.03)
SIGMA |= {"state/phi": 0.002, "state/theta": 0.002}
UNIT = dict.fromkeys(RATES, "rad/s") | dict.fromkeys(VELOCITY, "m/s") | dict.fromkeys(FELT, "m/s2")
UNIT |= {"state/phi": "rad", "state/theta": "rad"}


@lru_cache
def signals() -> np.ndarray:
    """Return two injected signals, each on every second line from 0.1 to 2 Hz."""
    time, rng = np.arange(round(PERIOD / DT) + 1) * DT, np.random.default_rng(3)
    lines = (np.arange(4 + i, 80, 2) / PERIOD for i in range(2))
    waves = (
        np.cos(2 * np.pi * np.outer(f, time) + rng.uniform(0, 7, (f.size, 1))).sum(axis=0) for f in lines
    )
    return np.array(list(waves)) * 0.01


def flown(modes: tuple[float, ...]) -> dict[str, np.ndarray]:
    """Return a flight, small about 20 m/s, whose rates and velocities ring at some frequencies, Hz.

    Attitude and specific force follow by the equations of motion in full, integrated and differentiated by
    Fourier series: the flight is periodic.
    """
    sent = signals()[:, :-1]
    hz = np.fft.rfftfreq(sent.shape[1], DT)
    each = np.fft.rfft(sent)
    ring = [1 / (1 - (hz / f) ** 2 + 0.16j * hz / f) for f in modes]
    motion = [
        (0.5 * each[i % 2] + 0.2 * each[1 - i % 2]) * ring[i % len(ring)] * (1 + i / 6) for i in range(6)
    ]

    def derived(x: np.ndarray) -> np.ndarray:
        return np.fft.irfft(np.fft.rfft(x) * 2j * np.pi * hz, x.shape[-1])

    p, q, r = (0.5 * np.fft.irfft(z, sent.shape[1]) for z in motion[:3])
    u, v, w = (np.fft.irfft(z, sent.shape[1]) for z in motion[3:])
    u, w = u + 20.0, w + 1.0
    phi, theta = np.zeros_like(p), np.full_like(p, 0.05)
    for _ in range(30):  # Picard's iteration of the Euler angles' equations
        turning = q * np.sin(phi) + r * np.cos(phi)
        slopes = p + np.tan(theta) * turning, q * np.cos(phi) - r * np.sin(phi)
        p, q = p - slopes[0].mean(), q - slopes[1].mean()  # so that it stays periodic
        phi, theta = (
            level + np.fft.irfft(np.fft.rfft(x) / np.where(hz, 2j * np.pi * hz, np.inf), x.size)
            for level, x in zip((0.0, 0.05), slopes, strict=True)
        )
    rates = np.array([p, q, r])
    there = np.array([u, v, w]) + np.cross(rates.T, LEVER).T
    gravity = G * np.array([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
    felt = derived(there) + np.cross(rates.T, there.T).T - gravity
    found = dict(zip((*RATES, *VELOCITY, *FELT), (*rates, u, v, w, *felt), strict=True))
    found |= {"state/phi": phi, "state/theta": theta}
    return {n: np.append(x, x[0]) for n, x in found.items()}


def recorded(clean: dict[str, np.ndarray], seed: int) -> FlightRecord:
    rng = np.random.default_rng(seed)
    places = dict.fromkeys(VELOCITY, (0.0, 0.0, 0.0)) | dict.fromkeys(FELT, LEVER)
    channels = [
        Channel(n, UNIT[n], x + SIGMA[n] * rng.standard_normal(x.size), 1 / DT, "made here", places.get(n))
        for n, x in clean.items()
    ]
    channels += [
        Channel(f"excitation/d{i + 1}", "rad", x, 1 / DT, "made here") for i, x in enumerate(signals())
    ]
    time = np.arange(signals().shape[1]) * DT
    return FlightRecord(time, {c.name: c for c in channels}, vehicle())


def missed(found: dict[str, np.ndarray], clean: dict[str, np.ndarray], name: str) -> float:
    apart, time = found[name] - clean[name], np.arange(clean[name].size)
    return float(np.std(apart - np.polyval(np.polyfit(time, apart, 1), time)))


@pytest.mark.parametrize("seed", range(2))
def test_a_mode_at_another_frequency_is_followed_in_all_channels(seed):
    clean, own = flown((0.5, 0.8)), flown((0.6, 0.95))
    record = recorded(clean, seed)
    lines = lines_of(record, 2.0)
    found = moved_as_recorded(record, own, lines, noise_of([record], lines, SIGMA))
    slowly = with_missed(record, own, lines)
    for name in (*RATES, "state/theta", "state/ay", "state/w"):
        left = missed(found, clean, name)
        assert left < 0.4 * missed(slowly, clean, name), name
        assert left < 0.05 * np.std(clean[name]), name


@pytest.mark.parametrize("seed", range(2))
def test_a_model_that_flies_as_the_record_stays_as_it_is(seed):
    clean = flown((0.5, 0.8))
    record = recorded(clean, seed)
    lines = lines_of(record, 2.0)
    found = moved_as_recorded(record, clean, lines, noise_of([record], lines, SIGMA))
    assert max(missed(found, clean, n) / SIGMA[n] for n in clean) < 0.1


def test_a_heading_that_ends_elsewhere_does_not_turn_the_rates():
    """Its end stands on every line: taken for a rate it made the yaw rate of a tilt-rotor 7 % wrong."""
    clean, own = flown((0.5, 0.8)), flown((0.6, 0.95))
    record = recorded(clean, 0)
    lines = lines_of(record, 2.0)
    without = moved_as_recorded(record, own, lines, noise_of([record], lines, SIGMA))
    turned = np.linspace(0.0, 0.5, record.time.size)
    headed = record.with_channels(Channel("state/psi", "rad", turned, 1 / DT, "made here"))
    sigma = SIGMA | {"state/psi": 0.002}
    found = moved_as_recorded(
        headed, own | {"state/psi": 0 * turned}, lines, noise_of([headed], lines, sigma)
    )
    assert missed(found, clean, "state/r") < 1.1 * missed(without, clean, "state/r")


@pytest.mark.parametrize("seed", range(2))
def test_an_effector_moves_as_it_is_recorded_where_that_is_not_noise(seed):
    clean, own = flown((0.5, 0.8)), flown((0.6, 0.95))
    rng, sigma = np.random.default_rng(seed), SIGMA | {"effector/d1": 1e-3, "effector/d2": 1e-3}
    feedback = {f"effector/d{i + 1}": x - 0.4 * clean["state/q"] for i, x in enumerate(signals())}
    simulated = {n: x + 0.4 * (clean["state/q"] - own["state/q"]) for n, x in feedback.items()}
    simulated["effector/d2"] = feedback["effector/d2"]  # this one moves as it is simulated
    record = recorded(clean, seed).with_channels(
        *(
            Channel(n, "rad", x + 1e-3 * rng.standard_normal(x.size), 1 / DT, "made here")
            for n, x in feedback.items()
        )
    )
    lines = lines_of(record, 2.0)
    found = moved_as_recorded(record, own | simulated, lines, noise_of([record], lines, sigma))
    assert missed(found, feedback, "effector/d1") < 0.1 * missed(simulated, feedback, "effector/d1")
    assert missed(found, feedback, "effector/d1") < 0.02 * np.std(feedback["effector/d1"])
    assert missed(found, feedback, "effector/d2") < 0.2e-3


def test_noise_of_repeats_is_theirs_where_it_is_more_than_the_sensors():
    clean = flown((0.5, 0.8))
    records = [recorded(clean, k) for k in range(3)]
    rng = np.random.default_rng(9)
    gusts = [5 * SIGMA["state/w"] * rng.standard_normal(r.time.size) for r in records]
    gusty = [
        r.with_channels(replace(r.channel("state/w"), values=r["state/w"] + x))
        for r, x in zip(records, gusts, strict=True)
    ]
    lines = lines_of(records[0], 2.0)
    found = noise_of(gusty, lines, SIGMA)
    white = {n: DT * s**2 for n, s in SIGMA.items()}
    assert np.median(found["state/q"]) == pytest.approx(white["state/q"], rel=0.4)
    assert np.median(found["state/w"]) == pytest.approx(26 * white["state/w"], rel=0.4)


class Flying(Linear):
    """A simulation that flies the aircraft as it was described."""

    def fly(self, record, effects=None, departures=None):
        own = motion(Truth(), SECONDS, SECONDS, 0)
        return {n: x for n, x in own.items() if n.startswith(("state/", "effector/"))}


def test_one_repeat_tells_the_motion_and_the_other_is_compared():
    """Columns whose noise is the residual's own made a body 5 % lighter than it was."""
    stiffer = SLOPES.copy()
    stiffer[2, 1] *= 2
    truth = Truth(slopes=tuple(map(tuple, stiffer)))
    flights = [fly(truth, noise=1.0, seed=k, duration=SECONDS, phases=0) for k in (1, 2)]
    (block,) = stack_of(Flying(), flights, ["one", "two"], (0.05, 2.0))
    again = flown_again(block, {}, seen=True)
    assert (again.names, len(again.residuals)) == (("two",), 1)
    assert np.array_equal(again.residual, block.residuals[1])
    assert np.allclose(again.covariance, 2 * block.covariance)
    clean, described = (motion(t, SECONDS, SECONDS, 0)["state/q"] for t in (truth, Truth()))
    every = [described, again.motion.maneuver.record["state/q"], *(f.record["state/q"] for f in flights)]
    spectra = block.lines.spectrum(np.array(every) - clean)[:, block.lines.driven]
    own, error, first, second = np.concatenate([spectra.real, spectra.imag], axis=1)
    assert np.std(error) < 0.02 * np.std(own)
    chance = 2.6 / np.sqrt(error.size)  # in 1 of 100 cases
    assert np.corrcoef(error, first)[0, 1] > chance
    assert abs(np.corrcoef(error, second)[0, 1]) < chance

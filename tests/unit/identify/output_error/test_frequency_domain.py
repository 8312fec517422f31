"""Output error on lines: delays are exact, time and frequency agree, transfer functions of any order."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lsim
from second_order import MODEL, TRUTH, fly

from freqid.core.errors import DataError, UsageError
from freqid.identify.output_error.estimate import Settings, estimate
from freqid.identify.output_error.forms.transfer_function import fit_on_lines, transfer_function
from freqid.identify.output_error.model import Signals
from freqid.identify.output_error.parameters import Choices

DT, DELAY = 0.02, 0.13
LINES = np.arange(0.05, 1.6, 0.025)


def pulse(t):
    """Return a sweep that begins and ends at rest, so that its transforms are complete."""
    window = np.clip(np.minimum(t - 1, 30 - t), 0, 1)
    return window * np.sin(2 * np.pi * 0.025 * t**2)


def signals(noise=0.0, seed=0):
    """Return the response of (s + 4) / (s^2 + 1.2 s + 4) to a delayed sweep, by scipy."""
    t = DT * np.arange(2500)
    u, late = pulse(t), pulse(t - DELAY)
    _, y, _ = lsim(([1.0, 4.0], [1.0, 1.2, 4.0]), late, t)
    y = y + noise * np.random.default_rng(seed).normal(size=t.size)
    return Signals(DT, {"de": u}, {"q": y})


@pytest.mark.parametrize("domain", ["time", "frequency"])
def test_a_transfer_function_with_delay_is_recovered(domain):
    model = transfer_function("q", "de", 1, 2, delay=True)
    start = {"b0": 3.0, "b1": 0.6, "a0": 3.0, "a1": 0.9, "tau": 0.05}
    found = estimate(
        model,
        [signals()],
        Choices(start=start, initial="zero"),
        Settings(domain=domain, lines_hz=LINES, trend="none"),
    )
    assert found.converged
    for name, value in {"b0": 4.0, "b1": 1.0, "a0": 4.0, "a1": 1.2}.items():
        assert found[name][0] == pytest.approx(value, rel=2e-3)
    # in time a late input is interpolated between its samples: half a sample late here, the worst case
    assert found["tau"][0] == pytest.approx(DELAY, abs=0.03 * DT)


def test_equation_error_on_lines_starts_it():
    fit = fit_on_lines("q", "de", 1, 2, [signals()], LINES, trend="none", delay_s=DELAY)
    found = dict(zip(fit.names, fit.estimate[0], strict=True))
    for name, value in {"b0": 4.0, "b1": 1.0, "a0": 4.0, "a1": 1.2}.items():
        assert found[name] == pytest.approx(value, rel=2e-3)


def test_a_numerator_of_higher_order_takes_the_rate_of_its_input():
    # (2 s^2 + 3 s + 1) / (s + 1) = 2 s + 1 for s not -1
    model = transfer_function("q", "de", 2, 1)
    t = DT * np.arange(2500)
    u = pulse(t)
    y = 2 * np.gradient(u, DT, edge_order=2) + u
    fit = fit_on_lines("q", "de", 2, 1, [Signals(DT, {"de": u}, {"q": y})], LINES[:20], trend="none")
    ratio = dict(zip(fit.names, fit.estimate[0], strict=True))
    found = estimate(
        model,
        [Signals(DT, {"de": u}, {"q": y})],
        Choices(fixed={"a0": 1.0}, start={"b2": 1.5, "b1": 2.0, "b0": 1.5}),
        Settings(domain="frequency", lines_hz=LINES[:20], trend="none"),
    )
    for name, value in {"b2": 2.0, "b1": 3.0, "b0": 1.0}.items():
        assert found[name][0] == pytest.approx(value, rel=5e-3)
    assert ratio["b2"] == pytest.approx(2.0, rel=5e-3)
    with pytest.raises(UsageError, match="orders of numerator and denominator are 3 and 1"):
        transfer_function("q", "de", 3, 1)


def test_time_and_frequency_agree():
    flight = [fly(1, noise=1.0, samples=2000, x0=(0.0, 0.0))]
    by_time = estimate(MODEL, flight)
    by_lines = estimate(
        MODEL, flight, None, Settings(domain="frequency", lines_hz=np.arange(0.05, 2.0, 0.0125), trend="line")
    )
    assert by_lines.converged
    assert "bias_az" in by_lines.held
    for name in TRUTH:
        apart = abs(by_lines[name][0] - by_time[name][0])
        assert apart < 4 * np.hypot(by_lines[name][1], by_time[name][1])


def test_lines_above_nyquist_are_refused():
    with pytest.raises(DataError, match=r"above the Nyquist frequency 12\.5 Hz"):
        estimate(MODEL, [fly()], None, Settings(domain="frequency", lines_hz=(1.0, 20.0)))
    with pytest.raises(UsageError, match="no frequencies are named"):
        estimate(MODEL, [fly()], None, Settings(domain="frequency"))

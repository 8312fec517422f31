"""Recursive transforms beside a closed form and the recursion written out; estimates beside bare numpy."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

from freqid.core.sections.identification import Identification
from freqid.identify.in_flight.recursive import RecursiveRegression, RecursiveTransform

DT = 0.02
LINES = np.arange(3, 109, 5) / 60.0


def integral(a: complex, omega: float, duration: float) -> complex:
    """Return the integral of exp(a t) exp(-j omega t) from 0 to the duration."""
    s = a - 1j * omega
    return (cmath.exp(s * duration) - 1) / s


def test_reading_at_any_time_gives_the_integral_up_to_then():
    """x = exp(-0.08 t) sin(2 pi 0.6 t) + 0.3 - 0.02 t: the integral has a closed form at every T."""
    pole, count = -0.08 + 2j * np.pi * 0.6, 3001
    t = DT * np.arange(count)
    x = np.exp(pole.real * t) * np.sin(pole.imag * t) + 0.3 - 0.02 * t
    transform = RecursiveTransform(1, DT, LINES)
    for i in range(count):
        transform.update(x[None, i : i + 1])
        if i not in (1003, 1500, 2222, 3000):
            continue
        end = DT * i
        for line, found in zip(LINES, transform.read()[0], strict=True):
            omega = 2 * np.pi * line
            exact = (integral(pole, omega, end) - integral(pole.conjugate(), omega, end)) / 2j
            last = cmath.exp(-1j * omega * end)
            one = (1 - last) / (1j * omega)
            exact += 0.3 * one - 0.02 * (one - end * last) / (1j * omega)
            assert abs(found - exact) < 2e-7 * end


def test_between_still_ends_it_is_the_recursion_written_out():
    x = np.random.default_rng(2).standard_normal(1100)
    x[:7] = x[-7:] = 0.0  # where the ends are still, their correction vanishes
    transform, plain = RecursiveTransform(1, DT, LINES), np.zeros(LINES.size, dtype=complex)
    for i, value in enumerate(x):
        transform.update(np.array([[value]]))
        plain = plain + value * np.exp(-2j * np.pi * LINES * (i * DT))  # X_i = X_(i-1) + x_i exp(-j w t_i)
    np.testing.assert_allclose(transform.read()[0], DT * plain, rtol=1e-11)


def test_parameters_in_flight_beside_bare_numpy():
    """A moment with a derivative, M = Iy q', noisy and drifting, against trapezoids and numpy's lstsq."""
    rng = np.random.default_rng(7)
    count, inertia, truth = 3001, 3.1, np.array([-9.0, -18.0, -42.0])
    t = DT * np.arange(count)
    tones = 2 * np.pi * np.outer(np.arange(3, 60) / 60.0, t)
    w, de = ((np.cos(tones + rng.uniform(0, 6, (57, 1)))).sum(axis=0) * a for a in (0.3, 0.01))
    q = np.zeros(count)
    for i in range(count - 1):  # q' = (theta x) / Iy, exact for inputs that are straight between samples
        decay, forced = truth[1] / inertia, (truth[0] * w + truth[2] * de)[i : i + 2] / inertia
        rise, grown = (forced[1] - forced[0]) / DT, np.exp(decay * DT)
        q[i + 1] = q[i] * grown + forced[0] * (grown - 1) / decay + rise * (grown - 1 - decay * DT) / decay**2
    measured = np.array([w, q, de]) + [[0.02], [0.001], [0.0005]] * rng.standard_normal((3, count))
    measured += [[1.0], [0.01], [0.05]] + [[0.01], [0.0], [0.001]] * t
    settings = Identification(regressors=("w", "q", "de"), responses=("M",), residuals="white")
    regression = RecursiveRegression(settings, DT, LINES)
    for i in range(count):
        if i == 2401:
            early = regression.estimate()["M"]
        sample = measured[:, i : i + 1]
        regression.update(sample, np.zeros((1, 1)), inertia * sample[1:2])

    def bare(n):
        kernel = np.exp(-2j * np.pi * np.outer(t[:n], LINES))
        x = np.vstack([measured[:, :n], np.ones(n), t[:n] / t[n - 1] - 0.5])
        x = np.trapezoid(x[:, :, None] * kernel, dx=DT, axis=1)
        z = inertia * (2j * np.pi * LINES * x[1] + measured[1, n - 1] * kernel[-1] - measured[1, 0])
        rows = np.vstack([x, np.ones(LINES.size), kernel[-1]])
        stacked = np.concatenate([rows.real, rows.imag], axis=1).T
        return np.linalg.lstsq(stacked, np.concatenate([z.real, z.imag]))[0][:3]

    for found, n in ((early, 2401), (regression.estimate()["M"], count)):
        assert found.time == pytest.approx(t[n - 1])
        np.testing.assert_allclose(found.estimate, bare(n), rtol=2e-3)
        np.testing.assert_allclose(found.estimate, truth, rtol=0.1)

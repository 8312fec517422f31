"""How often the 95 % intervals of identify/regression hold the truth: `python benchmarks/coverage.py`.

Noise is made in the time domain, transformed to the lines, fitted; an interval counts as good where it
holds the true parameter. It is a campaign of `freqid.monte_carlo` with `trials` as its stage, so it goes on
where it was stopped. Writes benchmarks/coverage.csv beside the table it prints.
"""

from __future__ import annotations

import csv
import json
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

import freqid as fq
from freqid.identify.regress.covariance_corrections import (
    correct_by_autocorrelation,
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.regress.regression import LeastSquares, least_squares

TRIALS, BATCH, DT = 20_000, 1_000, 0.1
COLOURS = ["white", "first order 0.1 s", "first order 0.5 s", "first order 2 s", "resonance 0.8 Hz"]


def make_noise(rng: np.random.Generator, n_samples: int, colour: str) -> np.ndarray:
    drive = rng.standard_normal((BATCH, n_samples + 300))
    if colour.startswith("first"):
        drive = lfilter([1.0], [1.0, -np.exp(-DT / float(colour.split()[2]))], drive)
    elif colour.startswith("resonance"):  # damping 0.15, standing out of white noise
        pole = np.exp(2 * np.pi * 0.8 * DT * (-0.15 + 1j))
        narrow = lfilter([1.0], np.poly([pole, pole.conjugate()]).real, drive)
        drive = narrow / narrow.std() + 0.5 * rng.standard_normal(narrow.shape)
    return drive[:, 300:]


def waves(rng: np.random.Generator, time: np.ndarray, harmonics: np.ndarray, n: int) -> np.ndarray:
    phase = rng.uniform(0, 2 * np.pi, (n, len(harmonics), 1))
    size = rng.standard_normal((n, len(harmonics), 1))
    return (size * np.sin(2 * np.pi * harmonics[:, None] * time / (time[-1] + DT) + phase)).sum(axis=1)


def multisines(duration: float) -> np.ndarray:
    """Eighteen interleaved multisines on harmonics 3..108 and three lagged mixtures of them."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, duration - DT / 2, DT)
    inputs = np.vstack([waves(rng, time, np.arange(3 + j, 109, 18), 1) for j in range(18)])
    lag = 1.0 / (1.0 + 2j * np.pi * np.fft.rfftfreq(len(time), DT) * np.array([[0.3], [1.0], [2.0]]))
    states = np.fft.irfft(np.fft.rfft(rng.standard_normal((3, 18)) @ inputs) * lag, len(time))
    return np.vstack([inputs, states])


def transients(duration: float) -> np.ndarray:
    """Five decaying broadband signals."""
    time = np.arange(0.0, duration - DT / 2, DT)
    return waves(np.random.default_rng(3), time, np.arange(1.5, 33.0), 5) * np.exp(-time / duration)


def hits(fit: LeastSquares, truth: np.ndarray) -> np.ndarray:
    low, high = fit.interval(0.95)
    return (low <= truth) & (truth <= high)


@lru_cache
def cases() -> dict[str, tuple[np.ndarray, np.ndarray | None, float]]:
    """Return signals, lines and duration by name."""
    few, many = np.arange(0.1, 1.8, 0.02), np.arange(0.1, 1.795, 0.01)
    return {
        "harmonics, 106 lines, 60 s, 21 parameters": (multisines(60.0), np.arange(3, 109) / 60.0, 60.0),
        "T df = 0.4, 86 lines, 20 s, 5 parameters": (transients(20.0), few, 20.0),
        "T df = 0.2, 170 lines, 20 s, 5 parameters": (transients(20.0), many, 20.0),
        "200 samples, 20 s, 6 parameters": (np.vstack([transients(20.0), np.ones(200)]), None, 20.0),
    }


def trials(seed: int, *, case: str, noise: str) -> dict[str, Any]:
    """Fit one batch of noise; a row for each trial, correction and parameter: the stage of the campaign."""
    signals, lines, duration = cases()[case]
    rng = np.random.default_rng([2026, seed, [*cases()].index(case), COLOURS.index(noise)])
    truth = rng.standard_normal(len(signals))
    time = DT * np.arange(signals.shape[1])
    kernel = None if lines is None else DT * np.exp(-2j * np.pi * time[:, None] * lines)
    phi = signals if kernel is None else signals @ kernel
    made = make_noise(rng, signals.shape[1], noise)
    fit = least_squares(phi, truth @ phi + (made if kernel is None else made @ kernel))
    if lines is None:
        fits = {
            "none": fit,
            "autocorrelation (published)": correct_by_autocorrelation(fit),
            "coloured samples": correct_coloured_samples(fit),
        }
    else:
        fits = {
            "none": fit,
            "line spacing": correct_line_spacing(fit, lines, duration),
            "coloured lines": correct_coloured_lines(fit, lines, duration),
        }
    held = np.stack([hits(corrected, truth) for corrected in fits.values()])
    names = np.array([f"{case}; {name}" for name in fits])
    index = np.indices(held.shape).reshape(3, -1)
    return {
        "fit": names[index[0]],
        "trial": index[1],
        "quantity": np.array([f"parameter {i}" for i in range(len(truth))])[index[2]],
        "covered": held.ravel(),
    }


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        campaign = Path(folder) / "coverage.toml"
        campaign.write_text(
            f'stage = "{Path(__file__).resolve()}:trials"\nseeds = {TRIALS // BATCH}\nbatch = 2\n'
            f'axis = "noise"\nby = "fit"\n'
            f"[vary]\ncase = {json.dumps([*cases()])}\nnoise = {json.dumps(COLOURS)}\n"
        )
        found = fq.monte_carlo(campaign, Path(folder) / "coverage", jobs=2)
    rows = []
    print(f"{TRIALS} trials a row; s.e. from the scatter of trials, binomial s.e. as if all were independent")
    parameters = sorted({m.quantity for m in found.measured if m.quantity})
    for m in sorted(
        found.of("coverage"),
        key=lambda m: ([*cases()].index(m.curve.partition("; ")[0]), COLOURS.index(str(m.at))),
    ):
        case, _, correction = m.curve.partition("; ")
        each = [x.mean for q in parameters for x in found.of("coverage", q, m.curve) if x.at == m.at]
        row = {
            "case": case,
            "noise": str(m.at),
            "correction": correction,
            "coverage_percent": f"{100 * m.mean:.2f}",
            "standard_error": f"{100 * (m.hi - m.lo) / (2 * 1.96):.2f}",
            "binomial_standard_error": f"{100 * np.sqrt(m.mean * (1 - m.mean) / m.count):.2f}",
            "worst_parameter": f"{100 * min(each):.1f}",
            "best_parameter": f"{100 * max(each):.1f}",
        }
        rows.append(row)
        print("  ".join(f"{value:<28}" if i < 3 else value for i, value in enumerate(row.values())))
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()

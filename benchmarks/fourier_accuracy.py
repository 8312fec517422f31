"""Accuracy and noise gain of the finite Fourier integral against the degree of its end corrections.

Run: python benchmarks/fourier_accuracy.py
The signal is exp(-0.08 t) sin(2 pi 0.6 t) + 0.3 - 0.02 t + 4e-4 t^2 over 60 s, the lines are spaced by
0.01 Hz; its integral is known in closed form. Gregory's weights, the same corrections at zero frequency,
act on the whole integrand x(t) exp(-j 2 pi f t).
Prints a table and writes benchmarks/fourier_accuracy.csv.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from freqid.identify.spectra.fourier import fourier_end_weights

DURATION = 60.0


def exact(f: np.ndarray) -> np.ndarray:
    """Return the closed form of the signal's integral."""
    k, T = 2j * np.pi * f, DURATION
    end = np.exp(-k * T)
    total = 0.3 * (1 - end) / k - 0.02 * (1 / k**2 - end * (T / k + 1 / k**2))
    total += 4e-4 * (2 / k**3 - end * (T**2 / k + 2 * T / k**2 + 2 / k**3))
    for sign in (1, -1):
        pole = -0.08 + sign * 2j * np.pi * 0.6 - k
        total += sign / 2j * (np.exp(pole * T) - 1) / pole
    return total


def figures(dt: float, f: np.ndarray, start: np.ndarray) -> tuple[float, float, float]:
    """Return the largest relative error, the relative rms error and the noise gain for given weights."""
    t = dt * np.arange(round(DURATION / dt) + 1)
    x = np.exp(-0.08 * t) * np.sin(2 * np.pi * 0.6 * t) + 0.3 - 0.02 * t + 4e-4 * t**2
    plain = np.exp(-2j * np.pi * np.outer(t, f))
    weights = plain.copy()
    weights[: len(start)] += start
    weights[t.size - len(start) :] += plain[-1] * start[::-1].conj()
    error = dt * (x @ weights) - exact(f)
    gain = np.sqrt(np.max(np.sum(np.abs(weights) ** 2, axis=0)) / t.size)
    return (
        float(np.max(np.abs(error / exact(f)))),
        float(np.linalg.norm(error) / np.linalg.norm(exact(f))),
        gain,
    )


def main() -> None:
    rows = ["rate_hz,band_to_hz,weights,order,largest_relative_error,relative_rms_error,noise_gain"]
    for rate, top in ((50, 2.0), (10, 3.0)):
        f = np.arange(0.05, top + 0.005, 0.01)
        theta = 2 * np.pi * f / rate
        for kind in ("freqid", "gregory"):
            for order in range(13):
                if kind == "freqid":
                    start = fourier_end_weights(theta, order)
                else:
                    start = fourier_end_weights(0 * theta, order)
                    start = start * np.exp(-1j * np.outer(np.arange(order + 1), theta))
                largest, rms, gain = figures(1 / rate, f, start)
                rows.append(f"{rate},{top},{kind},{order},{largest:.1e},{rms:.1e},{gain:.4f}")
    print("\n".join(row.replace(",", "\t") for row in rows))
    Path(__file__).with_suffix(".csv").write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()

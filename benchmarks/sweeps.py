"""A sweep's frequency response by four methods, against the exact one of an unstable plant under a regulator.

One input is swept from 0.04 to 1.2 Hz in 120 s; the injected signal is the instrument of every method.

- windows: overlapped Hann windows of four lengths, spectra averaged with weights ``(e_i / e_min)^-4``, e the
  random error of each;
- composite windows: the same lengths and weights, autospectra, real and imaginary cross-spectrum and, five
  times, the coherence merged by nonlinear least squares at each frequency (Tischler & Remple, 2nd ed.,
  ch. 10), of output and of input over the injected signal;
- local polynomials: those of the aircraft's response and of a transient on the lines of the whole record, as
  for multisines;
- whole record: what `estimate_swept_response` does.

Without noise, the largest error in dB and deg over the band and over its lowest octave; in noise (gusts and
sensors of `NOISE`), the rms error in dB over the band, the median of all flights.

    python benchmarks/sweeps.py [FLIGHTS]      writes sweeps.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

PROJECT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PROJECT / "tests" / "oracle"))

import closed_loop_plant as plant  # noqa: E402

from freqid.identify.response.frequency_response import estimate_swept_response  # noqa: E402
from freqid.identify.response.local_response import ResponseLines, local_response  # noqa: E402
from freqid.identify.response.swept_lines import swept_lines  # noqa: E402
from freqid.identify.spectra.fourier import FourierPlan  # noqa: E402

AT = np.geomspace(*plant.BAND, 40)
SHARES = (0.5, 0.33, 0.2, 0.12)  # lengths of the windows, of the sweep's
OUTPUTS = ("u", "w", "q")
NOISE = 0.05


def swept(seed: int, noise: float, spacing: str):
    """Return a flight in which the first input is swept and the second closes its own loop."""
    return plant.fly_sweeps(spacing, noise, noise, seed, both=False)


def spectra(signals: np.ndarray, samples: int, f: np.ndarray) -> tuple[np.ndarray, float]:
    """Return averaged cross-spectra of all rows, shape (row, row, M), and the windows that do not overlap."""
    plan, step = FourierPlan(samples, plant.DT, f), max(round(0.2 * samples), 1)
    taper, total, count = np.hanning(samples), 0.0, 0
    for start in range(0, signals.shape[1] - samples + 1, step):
        x = plan(signals[:, start : start + samples] * taper)
        total, count = total + x.conj()[:, None] * x[None], count + 1
    return total / count, signals.shape[1] / samples


def by_windows(signals: np.ndarray, composite: bool) -> np.ndarray:
    """Return responses of the rows from the second on to the second, by the first as instrument, (o, M)."""
    found, error = [], []
    for share in SHARES:
        samples = round(share * 120.0 / plant.DT) + 1
        reached = samples * plant.DT * AT >= 2  # periods of a frequency that a window has to hold
        part, n = spectra(signals - signals.mean(axis=1, keepdims=True), samples, AT[reached])
        G = np.ones((len(signals), len(signals), AT.size), dtype=complex)
        G[..., reached] = part
        c = np.abs(G[0]) ** 2 / (G[0, 0].real * np.einsum("iim->im", G).real)
        e = np.sqrt(np.maximum(1 - c, 1e-12) / (2 * c * n))
        e[:, ~reached] = np.inf
        found.append(G)
        error.append(e)
    G, error = np.array(found), np.array(error)  # (length, row, row, M), (length, row, M)
    weight = np.where(np.isfinite(error), (error / error.min(axis=0)) ** -4.0, 0.0)
    if not composite:
        w = weight[:, -1:] / weight[:, -1:].sum(axis=0)
        mean = (w * G[:, 0]).sum(axis=0)
        return mean[2:] / mean[1]
    ratios = np.array(
        [merged(G[:, 0, 0], G[:, 0, i], G[:, i, i], weight[:, i]) for i in range(1, len(signals))]
    )
    return ratios[1:] / ratios[0]


def merged(rr: np.ndarray, rx: np.ndarray, xx: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return rx / rr of composite spectra at each frequency; arguments of shape (length, M)."""
    ratio = np.empty(AT.size, dtype=complex)
    for k in range(AT.size):
        on = weight[:, k] > 0
        a, b, c, w = rr[on, k].real, xx[on, k].real, rx[on, k], np.sqrt(weight[on, k])
        coherence, scale = np.abs(c) ** 2 / (a * b), float(np.abs(c[0]))

        def left(x, a=a, b=b, c=c, w=w, coherence=coherence, scale=scale):
            together = (x[2] ** 2 + x[3] ** 2) / (x[0] * x[1])
            return np.concatenate(
                [
                    w * (x[0] - a / a[0]) * a[0] / a,
                    w * (x[1] - b / b[0]) * b[0] / b,
                    w * (x[2] * scale - c.real) / c.real,
                    w * (x[3] * scale - c.imag) / c.imag,
                    np.sqrt(5) * w * (together * scale**2 / (a[0] * b[0]) - coherence) / coherence,
                ]
            )

        start = [1.0, 1.0, c[0].real / scale, c[0].imag / scale]
        x = least_squares(left, start).x
        ratio[k] = (x[2] + 1j * x[3]) * scale / (x[0] * a[0])
    return ratio


def by_local_polynomials(flight) -> np.ndarray:
    r = flight.record["excitation/de1"][None]
    lines, _ = swept_lines(flight, slice(0, r.shape[1]), 0, r, "effector", ("de1",), OUTPUTS)
    lines = ResponseLines(lines.hz, lines.record, np.ones_like(lines.excited), lines.r, lines.u, lines.y)
    return np.array([local_response(lines, f, 2, 8).value[:, 0] for f in AT]).T


def by_whole_record(flight) -> np.ndarray:
    found = estimate_swept_response([flight], None, OUTPUTS)
    f, value = found.frequencies_hz, found.value[:, 0]
    # at the frequencies of the others: the response is smooth, so that splines add no error
    return CubicSpline(np.log(f), value, axis=1)(np.log(AT))


def estimates(flight) -> dict[str, np.ndarray]:
    record = flight.record
    signals = record.matrix(("excitation/de1", "effector/de1", *(f"state/{n}" for n in OUTPUTS)))
    return {
        "windows": by_windows(signals, composite=False),
        "composite windows": by_windows(signals, composite=True),
        "local polynomials": by_local_polynomials(flight),
        "whole record": by_whole_record(flight),
    }


def decibels(value, exact):
    return np.abs(20 * np.log10(np.abs(value / exact)))


def main(flights: int) -> None:
    exact = plant.one_response(AT)
    low = 2 * plant.BAND[0] >= AT
    rows = []
    for spacing in ("logarithmic", "linear"):
        clean = estimates(swept(0, 0.0, spacing))
        noisy = [estimates(swept(seed, NOISE, spacing)) for seed in range(flights)]
        for method, value in clean.items():
            gain, turn = decibels(value, exact), np.abs(np.degrees(np.angle(value / exact)))
            spread = [np.sqrt(np.mean(decibels(one[method], exact) ** 2)) for one in noisy]
            rows.append(
                {
                    "sweep": spacing,
                    "method": method,
                    "db": round(float(gain.max()), 4),
                    "deg": round(float(turn.max()), 3),
                    "db_lowest_octave": round(float(gain[:, low].max()), 4),
                    "deg_lowest_octave": round(float(turn[:, low].max()), 3),
                    "db_rms_in_noise": round(float(np.median(spread)), 3),
                    "flights": flights,
                }
            )
            print(rows[-1], flush=True)
    with (Path(__file__).with_suffix(".csv")).open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)

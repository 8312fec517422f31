"""Equation error on two real aircraft beside published references, and what moves the estimates.

ATTAS, short period from two elevator manoeuvres (reference: output error), and HFB-320, longitudinal in
turbulence (reference: filter error), both from the data of Jategaonkar, *Flight Vehicle System
Identification*, 2nd ed. Every case is fitted on samples or on lines; the other cases change one thing:
the derivative, the band, the clock of one channel, an instrument. Read beside
docs/theory/equation-error.md. Run as ``make bench`` or ``python benchmarks/equation_error.py``.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

import freqid as fq
from freqid.core.record import Channel
from freqid.flightlog.read import read_log
from freqid.identify.regress.covariance_corrections import correct_coloured_lines, correct_coloured_samples
from freqid.identify.regress.regression import LeastSquares, least_squares
from freqid.identify.spectra.fourier import FourierPlan, frequency_grid
from freqid.identify.spectra.smoothing import local_derivative, smooth
from freqid.identify.spectra.trend import remove_trend, trend_columns

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data" / "fvsysid"
G = 9.80665  # m/s2
# Constants that the reference of the HFB-320 was estimated with.
S_M, SC_IY, THRUST_MOMENT = 0.004028, 8.0027e-4, -7.0153e-6  # m2/kg, 1/(kg m), 1/(kg m)
V0, MASS, INCLINATION, RHO, HALF_CHORD = 104.67, 7472.0, 0.0524, 0.792, 1.215
TRIALS = 100
HFB_SHORT_PERIOD = (2.09, 0.51)  # rad/s and damping ratio of the reference model, for the instruments
BAND = {"ATTAS": (0.06, 0.02, 1.0), "HFB-320": (0.05, 0.01, 1.0)}  # Hz: about 1.5 / T to 1 Hz
Band = tuple[float, float, float]


class Equation(NamedTuple):
    """One response on p regressors over several flights: direct + d(momentum)/dt = theta x + constant.

    Attributes
    ----------
    names : tuple of str
        The parameters, as in the reference.
    flights : list of tuple of ndarray
        x of shape (p, sample), direct and momentum of shape (1, sample).
    dt : float
    """

    names: tuple[str, ...]
    flights: list[tuple[Array, Array, Array]]
    dt: float


def records_of(aircraft: str, folder: Path = DATA) -> list[fq.FlightRecord]:
    """Read the manoeuvres of one aircraft by its column map."""
    files, column_map = {
        "ATTAS": (("fAttasElv1.mat", "fAttasElv2.mat"), "attas.toml"),
        "HFB-320": (("hfb320_1_10.asc",), "hfb320.toml"),
    }[aircraft]
    return [read_log(folder / file, ROOT / "scenarios" / "maps" / column_map) for file in files]


def references(folder: Path = DATA) -> dict[str, dict[str, float]]:
    """Return the published parameters by aircraft; ATTAS's Zq is stated without the kinematic 1."""
    stored = json.loads((folder / "reference_values.json").read_text())
    tables = {"ATTAS": "ATTAS_TC11", "HFB-320": "HFB320_TC04"}
    found = {a: next(v for k, v in stored.items() if k.startswith(t)) for a, t in tables.items()}
    found["ATTAS"] = {**found["ATTAS"], "1+Zq": 1 + found["ATTAS"]["Zq"]}
    return found


def attas(records: Sequence[fq.FlightRecord], *, recorded: bool = False) -> list[Equation]:
    """Return alpha' and q' on alpha, q and elevator, linear and about zero as the reference is."""
    x = [r.matrix(("air/alpha", "state/q", "effector/de")) for r in records]
    alpha = [(a, 0 * a[:1], a[:1]) for a in x]
    q = [(a, 0 * a[:1], a[1:2]) for a in x]
    if recorded:
        q = [(a, r.matrix(["state/qdot"]), 0 * a[:1]) for a, r in zip(x, records, strict=True)]
    dt = records[0].dt
    return [
        Equation(("Zalpha", "1+Zq", "Zde"), alpha, dt),
        Equation(("Malpha", "Mq", "Mde"), q, dt),
    ]


def hfb(records: Sequence[fq.FlightRecord], *, recorded: bool = False) -> list[Equation]:
    """Return drag, lift and pitching moment coefficients, in stability axes as the reference is."""
    (record,) = records
    v, alpha, q = (record[n] for n in ("air/V", "air/alpha", "state/q"))
    de, thrust = record["effector/de"], record["effector/thrust"]
    qbar = 0.5 * RHO * v**2  # the reference's, not the measured one
    cx = (record["state/ax"] - thrust * np.cos(INCLINATION) / MASS) / (qbar * S_M)
    cz = (record["state/az"] + thrust * np.sin(INCLINATION) / MASS) / (qbar * S_M)
    cd, cl = -cx * np.cos(alpha) - cz * np.sin(alpha), cx * np.sin(alpha) - cz * np.cos(alpha)
    cm = -THRUST_MOMENT * thrust / (SC_IY * qbar)
    momentum = q / (SC_IY * qbar)
    if recorded:
        cm, momentum = cm + record["state/qdot"] / (SC_IY * qbar), 0 * q
    else:  # q'/qbar = (q/qbar)' + q qbar'/qbar^2
        cm = cm + momentum * local_derivative(qbar[None], record.dt)[0] / qbar
    x = np.array([v / V0, alpha, q * HALF_CHORD / V0, de])
    none = 0 * q[None]
    return [
        Equation(("CDV", "CDal"), [(x[:2], cd[None], none)], record.dt),
        Equation(("CLV", "CLal"), [(x[:2], cl[None], none)], record.dt),
        Equation(("CmV", "Cmal", "Cmq", "Cmde"), [(x, cm[None], momentum[None])], record.dt),
    ]


def kinematics(records: Sequence[fq.FlightRecord]) -> Equation:
    """Return measured alpha' on the alpha' of gyroscopes and accelerometers; the factor should be 1."""
    flights = []
    for r in records:
        v, alpha, beta = r.matrix(("air/V", "air/alpha", "air/beta"))
        p, q, yaw = r.matrix(("state/p", "state/q", "state/r"))
        ax, az = r.matrix(("state/ax", "state/az"))
        phi, theta = r.matrix(("state/phi", "state/theta"))
        down = az + G * np.cos(theta) * np.cos(phi)
        along = ax - G * np.sin(theta)
        rate = q - np.tan(beta) * (p * np.cos(alpha) + yaw * np.sin(alpha))
        rate += (down * np.cos(alpha) - along * np.sin(alpha)) / (v * np.cos(beta))
        flights.append((rate[None], 0 * alpha[None], alpha[None]))
    return Equation(("factor",), flights, records[0].dt)


EQUATIONS: dict[str, Callable[..., list[Equation]]] = {"ATTAS": attas, "HFB-320": hfb}


def fit_samples(equation: Equation, window: int = 3) -> LeastSquares:
    """Regress samples, with a local parabola's derivative and one constant for all flights."""
    x = np.concatenate([x for x, _, _ in equation.flights], axis=1)
    z = [d + (local_derivative(m, equation.dt, window) if m.any() else m) for _, d, m in equation.flights]
    one = np.ones((1, x.shape[1]))
    fit = least_squares(
        x, np.concatenate(z, axis=1), names=equation.names, nuisance=one, nuisance_names=["constant"]
    )
    return correct_coloured_samples(fit)


def fit_lines(equation: Equation, band: Band, *, instruments: bool = False, window: int = 1) -> LeastSquares:
    """Regress transforms; each flight has its own trend and end terms as nuisance columns.

    With `instruments` (HFB-320's moment only), alpha and q are replaced by what the elevator, sent through
    the short period, explains of them: two-stage least squares. With `window`, derivatives are weakened
    as by a parabola over so many samples.
    """
    parts, count = [], len(equation.flights)
    for i, (x, direct, momentum) in enumerate(equation.flights):
        plan = FourierPlan(x.shape[1], equation.dt, frequency_grid(*band))
        z = plan(remove_trend(direct, equation.dt, "line").x)
        nuisance = trend_columns(plan.frequencies_hz, plan.duration)
        if momentum.any():
            offset = np.arange(1, window // 2 + 1)
            angle = 2 * np.pi * plan.frequencies_hz * equation.dt
            gain = offset @ np.sin(np.outer(offset, angle)) / (offset @ offset * angle) if window > 1 else 1.0
            z = z + gain * plan.derivative(remove_trend(momentum, equation.dt, "endpoints").x)
            nuisance = np.concatenate([nuisance, plan.nuisance()])
        own = np.zeros((count, *nuisance.shape), dtype=complex)
        own[i] = nuisance
        x = plan(remove_trend(x, equation.dt, "line").x)
        if instruments:
            s, (omega, damping) = 2j * np.pi * plan.frequencies_hz, HFB_SHORT_PERIOD
            behind = x[3] / (s**2 + 2 * damping * omega * s + omega**2)
            stage = least_squares(np.array([x[0], x[3], behind, s * behind]), x[1:3], nuisance=nuisance)
            x[1:3] -= stage.residual
        parts.append((x, z, own.reshape(-1, nuisance.shape[1])))
    x, z, nuisance = (np.concatenate(rows, axis=1) for rows in zip(*parts, strict=True))
    fit = least_squares(x, z, names=equation.names, nuisance=nuisance)

    # Residuals of different flights are independent: each adds its own part of the covariance.
    each = plan.frequencies_hz.size
    covariances = []
    for i in range(count):
        part = slice(i * each, (i + 1) * each)
        alone = replace(
            fit, residual=fit.residual[:, part], dual=fit.dual[:, part], leverage=fit.leverage[part]
        )
        coloured = correct_coloured_lines(alone, plan.frequencies_hz, plan.duration)
        covariances.append(coloured.solution_covariance)
    return replace(fit, solution_covariance=np.sum(covariances, axis=0))


def shifted(
    records: Sequence[fq.FlightRecord], channel: str, advance: float, factor: float = 1.0
) -> list[fq.FlightRecord]:
    """Return records with one channel brought forward by some s, and divided by a factor about its mean."""
    moved = []
    for record in records:
        values = CubicSpline(record.time, record[channel])(record.time + advance)
        values = values.mean() + (values - values.mean()) / factor
        margin = int(np.ceil(abs(advance) / record.dt))
        there = record.with_channels(replace(record.channel(channel), values=values))
        moved.append(there.cut(record.time[margin], record.time[-1 - margin]))
    return moved


def sensor_noise(records: Sequence[fq.FlightRecord], channels: Sequence[str]) -> tuple[Array, Array]:
    """Return each channel's white noise and its signal-to-noise ratio, means over the flights."""
    levels = [smooth(r.matrix(channels), r.dt).noise_std for r in records]
    spreads = [r.matrix(channels).std(axis=1) for r in records]
    return np.mean(levels, axis=0), np.mean([s / n for s, n in zip(spreads, levels, strict=True)], axis=0)


def added_noise(equation: Equation, noise: Array, band: Band) -> Array:
    """Return the relative change that white noise added to the regressors should make on lines.

    theta' = (C + E)^-1 C theta, with C = Re Phi Phi^H and E the noise's own, sigma^2 dt T a line.
    """
    theta = fit_lines(equation, band).estimate[0]
    normal, own = np.zeros((2, noise.size, noise.size))
    for x, _, _ in equation.flights:
        plan = FourierPlan(x.shape[1], equation.dt, frequency_grid(*band))
        lines = plan(remove_trend(x, equation.dt, "line").x)
        normal += (lines @ lines.conj().T).real
        own += np.diag(noise**2) * equation.dt * plan.duration * plan.frequencies_hz.size
    return -np.linalg.solve(normal + own, own @ theta) / theta


def noisy(records: Sequence[fq.FlightRecord], levels: dict[str, float], seed: int) -> list[fq.FlightRecord]:
    """Return records with white noise of the stated standard deviations added."""
    rng = np.random.default_rng(seed)

    def more(record: fq.FlightRecord, name: str, level: float) -> Channel:
        noise = level * rng.standard_normal(record.time.size)
        return replace(record.channel(name), values=record[name] + noise)

    return [r.with_channels(*(more(r, *level) for level in levels.items())) for r in records]


def best_advance(
    build: Callable[[list[fq.FlightRecord]], Equation], records: Sequence[fq.FlightRecord], band: Band
) -> tuple[float, LeastSquares]:
    """Return the advance of alpha, s, that an equation fits best with, and that fit."""
    fits = {
        a: fit_lines(build(shifted(records, "air/alpha", a)), band) for a in np.arange(-50, 305, 10) / 1e3
    }
    best = max(fits, key=lambda a: float(fits[a].r2[0]))
    return float(best), fits[best]


def cases(aircraft: str, records: list[fq.FlightRecord]) -> dict[str, list[LeastSquares]]:
    """Return the fits by case, of those equations that the case changes."""
    build, (low, step, high) = EQUATIONS[aircraft], BAND[aircraft]

    def on_lines(
        flown: Sequence[fq.FlightRecord], bottom: float = low, top: float = high
    ) -> list[LeastSquares]:
        return [fit_lines(e, (bottom, step, top)) for e in build(flown)]

    recorded = build(records, recorded=True)[-1]
    changed = [e for e in build(records) if any(m.any() for _, _, m in e.flights)]  # those with a derivative
    found = {"samples, derivative over 3": [fit_samples(e, 3) for e in build(records)]}
    for w in (5, 9):
        found[f"samples, derivative over {w}"] = [fit_samples(e, w) for e in changed]
    found["samples, recorded q'"] = [fit_samples(recorded)]
    found[f"lines {low:g}-{high:g} Hz"] = on_lines(records)
    found[f"lines {low:g}-4.9 Hz"] = on_lines(records, top=4.9)
    wide = (low, step, 4.9)
    for w in (3, 9):
        found[f"lines {low:g}-4.9 Hz, gain of {w}"] = [fit_lines(e, wide, window=w) for e in changed]
    found["lines, recorded q'"] = [fit_lines(recorded, BAND[aircraft])]
    if aircraft == "ATTAS":
        for sooner in (-0.01, 0.01):
            flown = shifted(records, "effector/de", sooner)
            found[f"lines, elevator {1e3 * sooner:+.0f} ms"] = on_lines(flown)
        late, factor = best_advance(kinematics, records, BAND[aircraft])
        set_right = shifted(records, "air/alpha", late, factor.estimate[0, 0])
        found["lines, alpha set right"] = on_lines(set_right)
        return found
    found[f"lines 0.02-{high:g} Hz"] = on_lines(records, bottom=0.02)
    for sooner in (0.1, 0.2):
        found[f"lines, alpha {1e3 * sooner:+.0f} ms"] = on_lines(shifted(records, "air/alpha", sooner))
    for sooner in (0.0, 0.1):
        moment = build(shifted(records, "air/alpha", sooner))[-1]
        name = f"instruments, alpha {1e3 * sooner:+.0f} ms"
        found[name] = [fit_lines(moment, BAND[aircraft], instruments=True)]
    return found


def causes(aircraft: str, records: list[fq.FlightRecord]) -> None:
    """Print sensor noise and what five times as much does, and how late alpha is."""
    build, band, channels = EQUATIONS[aircraft], BAND[aircraft], ("air/alpha", "state/q", "effector/de")
    noise, ratio = sensor_noise(records, channels)
    for name, level, snr in zip(channels, noise, ratio, strict=True):
        print(f"white noise of {name}: {level:.2g}, signal over noise {snr:.0f}")
    moment = build(records)[-1]
    of_regressor = noise if aircraft == "ATTAS" else np.array([0.0, *noise]) * [1, 1, HALF_CHORD / V0, 1]
    levels = dict(zip(channels, 5 * noise, strict=True))
    flights = (build(noisy(records, levels, seed))[-1] for seed in range(TRIALS))
    tried = np.mean([fit_lines(e, band).estimate[0] for e in flights], axis=0)
    changes = {
        "the same noise once more, predicted": added_noise(moment, of_regressor, band),
        "five times as much, predicted": added_noise(moment, 5 * of_regressor, band),
        f"five times as much, mean of {TRIALS}": tried / fit_lines(moment, band).estimate[0] - 1,
    }
    for what, change in changes.items():
        print(f"{what}:", *(f"{n} {100 * c:+.2f} %" for n, c in zip(moment.names, change, strict=True)))
    late, fit = best_advance(kinematics, records, band)
    factor, r2 = fit.estimate[0, 0], fit.r2[0]
    print(f"kinematics: alpha is late by {1e3 * late:.0f} ms, factor {factor:.3f}, R2 {r2:.4f}")
    for i, equation in enumerate(build(records)):
        late, fit = best_advance(lambda r, i=i: build(r)[i], records, band)
        print(f"equation of {equation.names[-1]}: fits best at {1e3 * late:.0f} ms, R2 {fit.r2[0]:.4f}")


def main() -> None:
    """Print every case beside its reference, and write the table."""
    if not DATA.is_dir():
        print("the flight data are not beside this checkout (../shared/data): nothing done")
        return
    rows = []
    for aircraft, reference in references().items():
        records = records_of(aircraft)
        for case, fits in cases(aircraft, records).items():
            for fit in fits:
                for name, value, error in zip(fit.names, fit.estimate[0], fit.std_error[0], strict=True):
                    bias = value - reference[name]
                    row = {
                        "aircraft": aircraft,
                        "case": case,
                        "parameter": name,
                        "estimate": f"{value:.4g}",
                        "std_error": f"{error:.2g}",
                        "reference": f"{reference[name]:.4g}",
                        "bias": f"{bias:.2g}",
                        "bias_percent": f"{100 * bias / reference[name]:.1f}",
                        "r2": f"{fit.r2[0]:.4f}",
                    }
                    widths = (8, 30, 7, 9, 8, 9, 8, 8, 7)
                    print("  ".join(f"{v:<{w}}" for v, w in zip(row.values(), widths, strict=True)))
                    rows.append(row)
        causes(aircraft, records)
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()

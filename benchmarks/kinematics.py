"""Whether the compatibility check finds injected sensor errors, and its 95 % intervals hold them.

A flight whose motion is known in closed form (Euler angles and air-relative velocity are sums of sines, so
rates and specific forces follow by differentiation, without integrating anything), with random sensor errors
and noise of research quality; then the ATTAS and HFB-320 records of Jategaonkar, *Flight Vehicle System
Identification*. Run as ``make bench`` or ``python benchmarks/kinematics.py``; read beside
docs/theory/kinematics.md.
"""

from __future__ import annotations

import csv
import os
import time
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.signal import lfilter

import freqid as fq
from freqid.core.record import Channel
from freqid.flightlog.read import read_log
from freqid.identify.sensors.kinematics import KinematicCheck, KinematicSettings, check_kinematics

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data" / "fvsysid"
G = 9.80665
TRIALS, FURTHER_TRIALS = 200, 100
GUST_TIME = 0.3  # s, of the coloured noise that gusts and upwash are to vanes
TONES = np.array([0.06, 0.11, 0.17, 0.28, 0.43, 0.7])  # Hz
NOISE = {"rate": np.deg2rad(0.1), "force": 0.01 * G, "attitude": np.deg2rad(0.1), "velocity": 0.15}
NOISE |= {"angle": np.deg2rad(0.15), "height": 0.3}
# Standard deviations of the errors that are injected, by the second word of a parameter, or by the whole.
INJECTED = {"rate": 0.004, "force": 0.1, "attitude": 0.005, "angle": 0.02, "velocity": 0.5}
INJECTED |= {"scale": 0.05, "delay": 0.06, "wind": 3.0}
CHANNELS = {
    "rate": ("p", "q", "r"),
    "force": ("ax", "ay", "az"),
    "attitude": ("phi", "theta", "psi"),
    "angle": ("alpha", "beta"),
    "velocity": ("V", "u", "v", "w", "vn", "ve", "vd"),
    "height": ("alt",),
}
KIND = {name: kind for kind, names in CHANNELS.items() for name in names}
AIR_DATA = ("V", "alpha", "beta", "phi", "theta", "psi")
WITH_GROUND = ("u", "v", "w", "phi", "theta", "psi", "alt", "vn", "ve", "vd")
# The errors that each suite of sensors is tried with.
ERRORS = {
    AIR_DATA: (
        *(f"{n} bias" for n in ("p", "q", "r", "ax", "ay", "az", "alpha", "beta", "phi")),
        *(f"{n} scale" for n in ("V", "alpha", "beta")),
        *(f"{n} delay" for n in ("V", "alpha", "beta", "attitude")),
    ),
    WITH_GROUND: (
        *(f"{n} bias" for n in ("p", "q", "r", "ax", "ay", "az", "u", "v", "w", "phi", "theta")),
        *(f"{n} scale" for n in ("u", "v", "w")),
        *(f"{n} delay" for n in ("u", "v", "w", "attitude", "ground")),
        *(f"wind {a}" for a in ("north", "east", "down")),
    ),
}


class Motion:
    """A smooth motion in closed form: level flight at 25 m/s with everything moving.

    Parameters
    ----------
    rng : numpy.random.Generator
        Of the phases and sizes of its sines.
    """

    def __init__(self, rng: np.random.Generator):
        self._phase = rng.uniform(0, 2 * np.pi, (6, TONES.size))
        share = rng.uniform(0.5, 1.0, (6, TONES.size))
        size = np.array([0.25, 0.12, 0.3, 2.5, 1.5, 2.0])[:, None]
        self._size = size * share / np.sqrt((share**2).sum(axis=1, keepdims=True))
        self._mean = np.array([0.0, 0.07, 0.5, 25.0, 0.0, 1.8])

    def _sines(self, t: np.ndarray, derivative: int) -> np.ndarray:
        turns = 2 * np.pi * TONES[:, None] * t + self._phase[:, :, None] + derivative * np.pi / 2
        value = (self._size[:, :, None] * (2 * np.pi * TONES[:, None]) ** derivative * np.sin(turns)).sum(
            axis=1
        )
        return value + (self._mean[:, None] if derivative == 0 else 0.0)

    def euler(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return phi theta psi or their derivative, shape (3, sample)."""
        return self._sines(t, derivative)[:3]

    def velocity(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return u v w relative to the air or their derivative, shape (3, sample)."""
        return self._sines(t, derivative)[3:]

    def rates(self, t: np.ndarray) -> np.ndarray:
        """Return p q r (Klein & Morelli, 2nd ed., ch. 3)."""
        (phi, theta, _), (dphi, dtheta, dpsi) = self.euler(t), self.euler(t, 1)
        return np.array(
            [
                dphi - dpsi * np.sin(theta),
                dtheta * np.cos(phi) + dpsi * np.cos(theta) * np.sin(phi),
                -dtheta * np.sin(phi) + dpsi * np.cos(theta) * np.cos(phi),
            ]
        )

    def specific_force(self, t: np.ndarray, arm: np.ndarray) -> np.ndarray:
        """Return ax ay az of accelerometers at `arm` from the centre of gravity."""
        phi, theta, _ = self.euler(t)
        gravity = G * np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
        w, step = self.rates(t), 1e-4
        turning = (self.rates(t + step) - self.rates(t - step)) / (2 * step)
        force = self.velocity(t, 1) + np.cross(w, self.velocity(t), axis=0) - gravity
        d = np.broadcast_to(arm[:, None], w.shape)
        return force + np.cross(turning, d, axis=0) + np.cross(w, np.cross(w, d, axis=0), axis=0)

    def over_ground(self, t: np.ndarray, wind: np.ndarray) -> np.ndarray:
        """Return vn ve vd."""
        phi, theta, psi = self.euler(t)
        u, v, w = self.velocity(t)
        v, w = v * np.cos(phi) - w * np.sin(phi), v * np.sin(phi) + w * np.cos(phi)  # undo roll
        u, w = u * np.cos(theta) + w * np.sin(theta), -u * np.sin(theta) + w * np.cos(theta)  # undo pitch
        u, v = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)  # undo heading
        return np.array([u, v, w]) + wind[:, None]

    def quantity(self, name: str, t: np.ndarray, wind: np.ndarray, arm: np.ndarray) -> np.ndarray:
        """Return what an ideal sensor shows."""
        u, v, w = self.velocity(t)
        if name in ("phi", "theta", "psi"):
            return self.euler(t)[("phi", "theta", "psi").index(name)]
        if name in ("p", "q", "r"):
            return self.rates(t)[("p", "q", "r").index(name)]
        if name in ("ax", "ay", "az"):
            return self.specific_force(t, arm)[("ax", "ay", "az").index(name)]
        if name in ("vn", "ve", "vd"):
            return self.over_ground(t, wind)[("vn", "ve", "vd").index(name)]
        if name == "alt":  # the one integral: Simpson's rule between the samples
            fine = np.linspace(t[0], t[-1], 8 * (t.size - 1) + 1)
            down, step = self.over_ground(fine, wind)[2], fine[1] - fine[0]
            pieces = (step / 3) * (down[:-2:2] + 4 * down[1:-1:2] + down[2::2])
            return 100 - np.concatenate(([0.0], np.cumsum(pieces)))[::4]
        speed = np.sqrt(u**2 + v**2 + w**2)
        return {"u": u, "v": v, "w": w, "V": speed, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / speed)}[
            name
        ]


def fly(
    seed: int,
    channels: tuple[str, ...],
    errors: dict[str, float],
    *,
    noise: float = 1.0,
    duration: float = 40.0,
    dt: float = 0.04,
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    gusts: float = 0.0,
) -> fq.FlightRecord:
    """Return the record of a flight with known sensor errors, ``(1 + scale) true(t - delay) + bias``.

    `gusts` adds first-order noise to the air data, of so many times the standard deviation of the white one.
    """
    rng = np.random.default_rng(seed)
    motion, t = Motion(rng), dt * np.arange(round(duration / dt) + 1)
    wind = np.array([errors.get(f"wind {a}", 0.0) for a in ("north", "east", "down")])
    clock = dict.fromkeys(CHANNELS["attitude"], "attitude") | dict.fromkeys(("vn", "ve", "vd"), "ground")
    rows = {}
    for name in ("p", "q", "r", "ax", "ay", "az", *channels):
        seen = motion.quantity(
            name, t - errors.get(f"{clock.get(name, name)} delay", 0.0), wind, np.array(arm)
        )
        value = (1 + errors.get(f"{name} scale", 0.0)) * seen + errors.get(f"{name} bias", 0.0)
        value = value + noise * NOISE[KIND[name]] * rng.standard_normal(t.size)
        group = "air" if name in ("V", "alpha", "beta") else "state"
        if group == "air" and gusts:
            decay = np.exp(-dt / GUST_TIME)
            drive = np.random.default_rng([seed, ord(name[0])]).standard_normal(t.size)
            gust = lfilter([np.sqrt(1 - decay**2)], [1, -decay], drive)
            value = value + gusts * NOISE[KIND[name]] * gust
        place = arm if name in ("ax", "ay", "az") and any(arm) else None
        rows[f"{group}/{name}"] = Channel(f"{group}/{name}", "", value, 1 / dt, "made", place)
    return fq.FlightRecord(t, rows)


def draw(rng: np.random.Generator, names: tuple[str, ...]) -> dict[str, float]:
    """Return random sensor errors."""
    sigma = {
        n: INJECTED[
            n.split()[-1] if n.split()[-1] in INJECTED else "wind" if n[:4] == "wind" else KIND[n.split()[0]]
        ]
        for n in names
    }
    return {n: s * rng.standard_normal() for n, s in sigma.items()}


class Case(NamedTuple):
    """Flights with one suite of sensors, tried alike.

    Attributes
    ----------
    name : str
    suite : tuple of str
    trials : int
    also : tuple of str
        Errors that are injected and estimated beside those of the suite.
    gusts : float
    """

    name: str
    suite: tuple[str, ...]
    trials: int
    also: tuple[str, ...] = ()
    gusts: float = 0.0


CASES = (
    Case("air data", AIR_DATA, TRIALS),
    Case("velocity over ground", WITH_GROUND, TRIALS),
    Case("air data, everything", AIR_DATA, FURTHER_TRIALS, also=("V bias", "theta bias")),
    Case("air data, gusts", AIR_DATA, FURTHER_TRIALS, gusts=2.0),
)


def trial(seed: int, case: Case) -> tuple[dict[str, float], KinematicCheck]:
    """Return injected errors and what the check makes of them."""
    names = (*ERRORS[case.suite], *case.also)
    errors = draw(np.random.default_rng([seed, 1]), names)
    record = fly(seed, case.suite, errors, gusts=case.gusts)
    return errors, check_kinematics(record, KinematicSettings(parameters=names))


def rows_of(case: Case) -> list[dict[str, str]]:
    """Fly all flights of a case and return a row for each parameter, and one for all together."""
    found: dict[str, list[tuple[float, float, bool]]] = {n: [] for n in (*ERRORS[case.suite], *case.also)}
    start = time.perf_counter()
    for seed in range(case.trials):
        errors, check = trial(seed, case)
        for n, value, error, low, high in zip(
            check.names, check.estimate, check.std_error, check.lower, check.upper, strict=True
        ):
            found[n].append((value - errors[n], error, bool(low <= errors[n] <= high)))
    print(f"{case.name}: {(time.perf_counter() - start) / case.trials:.2f} s a check, {case.trials} flights")
    rows = []
    for name, of in (*found.items(), ("all", [t for each in found.values() for t in each])):
        off, error, good = np.array(of).T if of else np.full((3, 1), np.nan)
        alone = name != "all"
        flown = case.trials * (1 if alone else len(found))
        row = {
            "flight": case.name,
            "parameter": name,
            "told": f"{len(of) / flown:.3f}",
            "mean_error": f"{off.mean():.2g}" if alone else "",
            "std_of_error": f"{off.std():.3g}" if alone else "",
            "mean_std_error": f"{np.sqrt(np.mean(error**2)):.3g}" if alone else "",
            "rms_error_over_stated": f"{np.sqrt(np.mean((off / error) ** 2)):.2f}",
            "coverage": f"{good.mean():.3f}",
        }
        print("  ".join(f"{v:<{w}}" for v, w in zip(row.values(), (20, 15, 6, 9, 9, 9, 5, 6), strict=True)))
        rows.append(row)
    return rows


def main() -> None:
    """Print the tables and write them."""
    rows = [row for case in CASES for row in rows_of(case)]
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    if DATA.is_dir():
        real()


def real() -> None:
    """Print what the check says of the real records."""
    for map_name, files in (
        ("attas", ("fAttasElv1.mat", "fAttasElv2.mat", "fAttasAil1.mat", "fAttasRud1.mat")),
        ("hfb320", ("hfb320_1_10.asc",)),
    ):
        for file in files:
            check = check_kinematics(read_log(DATA / file, ROOT / "scenarios" / "maps" / f"{map_name}.toml"))
            print(file)
            for name, unit, value, error in zip(
                check.names, check.units, check.estimate, check.std_error, strict=True
            ):
                print(f"  {name:<14} {value:10.4g} +- {error:8.2g} {unit}")
            for name, others in check.undetermined.items():
                print(f"  {name} is not told; it would appear as {', '.join(others) or 'no other alone'}")
            for name, before in check.rms_before.items():
                print(f"  {name:<12} residual {before:8.3g} -> {check.rms_after[name]:8.3g}")


if __name__ == "__main__":
    main()

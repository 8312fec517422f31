"""Output error and filter error on real aircraft beside published values.

Twin Otter (Klein & Morelli, 2nd ed., examples 6.1 and 7.1: time and frequency domain, coefficients with
constants at the record's means), F-16XL in a water tunnel (example 7.2: unsteady normal force), ATTAS short
period, HFB-320 in turbulence (reference: filter error) and a simulated unstable aircraft, from the data of
Jategaonkar, *Flight Vehicle System Identification*, 2nd ed. Each row is one parameter. Read beside
docs/theory/output-error.md. Run as ``make bench`` or ``python benchmarks/output_error_references.py``.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.io import loadmat

from freqid.core.results.output_error import OutputErrorModel
from freqid.flightlog.read import read_log
from freqid.identify.output_error.estimate import Settings, estimate
from freqid.identify.output_error.forms.transfer_function import fit_on_lines, transfer_function
from freqid.identify.output_error.model import DynamicModel, Named, Signals
from freqid.identify.output_error.parameters import Choices

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"
G = 9.80665


class Case(NamedTuple):
    """One estimation beside its reference.

    Attributes
    ----------
    found : OutputErrorModel
    reference : dict of str to float
    std_error : dict of str to float
        As published; empty where none were.
    """

    found: OutputErrorModel
    reference: dict[str, float]
    std_error: dict[str, float]


def stored(folder: str, key: str, data: Path = DATA) -> dict:
    """Return the first reference whose name begins with `key`."""
    table = json.loads((data / folder / "reference_values.json").read_text())
    return next(value for name, value in table.items() if name.startswith(key))


def twin_otter(data: Path = DATA) -> tuple[DynamicModel, Signals]:
    """Return example 6.1: perturbations from the first sample, constants at the record's means."""
    record = read_log(data / "sidpac" / "totter_f1_017_data.mat")
    assert record.vehicle is not None
    vehicle, mass = record.vehicle, record.vehicle.mass_properties
    speed, qbar, alpha, theta = (
        float(record[n].mean()) for n in ("air/V", "air/qbar", "air/alpha", "state/theta")
    )
    assert vehicle.area_m2 is not None
    assert vehicle.span_m is not None
    area, span, inertia = vehicle.area_m2, vehicle.span_m, mass.inertia
    determinant = inertia.xx * inertia.zz - inertia.xz**2
    side, turn = qbar * area / mass.mass_kg, qbar * area * span / determinant

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        roll, yaw = x["p"] * span / (2 * speed), x["r"] * span / (2 * speed)
        cy = p["CYb"] * x["beta"] + p["CYr"] * yaw + p["CYdr"] * u["dr"]
        c = {
            m: p[f"C{m}b"] * x["beta"]
            + p[f"C{m}p"] * roll
            + p[f"C{m}r"] * yaw
            + p[f"C{m}da"] * u["da"]
            + p[f"C{m}dr"] * u["dr"]
            for m in "ln"
        }
        rates = {
            "beta": side / speed * cy
            + np.sin(alpha) * x["p"]
            - np.cos(alpha) * x["r"]
            + G / speed * np.cos(theta) * x["phi"]
            + p["bias_betadot"],
            "p": turn * (inertia.zz * c["l"] + inertia.xz * c["n"]) + p["bias_pdot"],
            "r": turn * (inertia.xz * c["l"] + inertia.xx * c["n"]) + p["bias_rdot"],
            "phi": x["p"] + np.tan(theta) * x["r"] + p["bias_phidot"],
        }
        return rates, {**x, "ay": side / G * cy + p["bias_ay"]}

    order = stored("sidpac", "ex6.1", data)["order"].split(",")
    own = tuple(n for n in order if n.startswith("bias"))
    model = DynamicModel(
        "Twin Otter, lateral",
        ("beta", "p", "r", "phi"),
        ("da", "dr"),
        ("beta", "p", "r", "phi", "ay"),
        tuple(order),
        equations,
        own=own,
    )

    def away(name: str) -> np.ndarray:
        return record[name] - record[name][0]

    outputs = {"beta": away("air/beta"), **{n: away(f"state/{n}") for n in ("p", "r", "phi")}}
    outputs["ay"] = away("state/ay") / G
    return model, Signals(record.dt, {n: away(f"effector/{n}") for n in ("da", "dr")}, outputs)


def twin_otter_in_time(data: Path = DATA) -> Case:
    """Return example 6.1, 18 parameters; Cramer-Rao bounds take residuals to be white, as published."""
    model, signals = twin_otter(data)
    found = estimate(model, [signals], Choices(initial="zero"), Settings(residuals="white"))
    reference = stored("sidpac", "ex6.1", data)
    order = reference["order"].split(",")
    return Case(
        found,
        dict(zip(order, reference["p"], strict=True)),
        dict(zip(order, reference["crb_se"], strict=True)),
    )


def twin_otter_on_lines(data: Path = DATA) -> Case:
    """Return example 7.1, 13 parameters, 0.1 to 1.5 Hz."""
    model, signals = twin_otter(data)
    lines = tuple(0.1 + 0.02 * np.arange(71))
    found = estimate(model, [signals], None, Settings(domain="frequency", lines_hz=lines))
    reference = stored("sidpac", "ex7.1_frequency_domain_output", data)
    order = reference["order"].split(",")
    return Case(
        found, dict(zip(order, reference["p"], strict=True)), dict(zip(order, reference["se"], strict=True))
    )


def f16xl(data: Path = DATA) -> tuple[dict[str, float], Case]:
    """Return example 7.2: equation error on lines, and output error from there."""
    table = loadmat(data / "sidpac" / "f16xl_r1263e_data.mat")["dat"]
    signals = Signals(0.1, {"alpha": np.radians(table[:, 2])}, {"CN": table[:, 10]})
    lines = 0.008 + 0.002 * np.arange(97)
    fit = fit_on_lines("CN", "alpha", 2, 1, [signals], lines)
    start = dict(zip(fit.names, fit.estimate[0].tolist(), strict=True))
    found = estimate(
        transfer_function("CN", "alpha", 2, 1),
        [signals],
        Choices(start=start),
        Settings(domain="frequency", lines_hz=tuple(lines), trend="line"),
    )
    reference, order = stored("sidpac", "ex7.2", data), ("b2", "b1", "b0", "a0")
    published = {kind: dict(zip(order, reference[kind], strict=True)) for kind in ("EE", "OE", "OE_se")}
    apart = {n: start[n] / published["EE"][n] - 1 for n in order}
    return apart, Case(found, published["OE"], published["OE_se"])


def attas(*, one_start: bool, data: Path = DATA) -> Case:
    """Return the short period of two manoeuvres; with `one_start` both begin at the first one's sample."""
    reference = stored("fvsysid", "ATTAS_TC11", data)

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        rates = {
            "alpha": p["Z0"] + p["Zalpha"] * x["alpha"] + (1 + p["Zq"]) * x["q"] + p["Zde"] * u["de"],
            "q": p["M0"] + p["Malpha"] * x["alpha"] + p["Mq"] * x["q"] + p["Mde"] * u["de"],
        }
        return rates, dict(x)

    model = DynamicModel(
        "ATTAS, short period", ("alpha", "q"), ("de",), ("alpha", "q"), tuple(reference), equations
    )
    signals = []
    for name in ("fAttasElv1", "fAttasElv2"):
        contents = loadmat(data / "fvsysid" / f"{name}.mat")
        table = np.radians(next(v for k, v in contents.items() if not k.startswith("_")))
        signals.append(Signals(0.04, {"de": table[:, 21]}, {"alpha": table[:, 12], "q": table[:, 7]}))
    choices = Choices()
    if one_start:
        first = {f"x0_{n}@2": float(signals[0].outputs[n][0]) for n in ("alpha", "q")}
        choices = Choices(initial="measured", fixed=first)
    return Case(estimate(model, signals, choices), reference, {})


def hfb320(method: str, data: Path = DATA) -> Case:
    """Return longitudinal motion in turbulence, with the equations and constants of the reference."""
    table = np.loadtxt(data / "fvsysid" / "hfb320_1_10.asc")
    c = stored("fvsysid", "HFB320_constants", data)
    reference = stored("fvsysid", "HFB320_TC04", data)
    speed, mass, tilt = c["V0"], c["mass"], c["thrust_incl_rad"]

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        v, alpha, theta, q, thrust = x["V"], x["alpha"], x["theta"], x["q"], u["thrust"]
        qbar = 0.5 * c["rho"] * v**2
        cd = p["CD0"] + p["CDV"] * v / speed + p["CDal"] * alpha
        cl = p["CL0"] + p["CLV"] * v / speed + p["CLal"] * alpha
        cm = p["Cm0"] + p["CmV"] * v / speed + p["Cmal"] * alpha
        cm = cm + p["Cmq"] * q * c["c/2_in_q_term"] / speed + p["Cmde"] * u["de"]
        qdot = qbar * c["S*c/Iy"] * cm + c["thrust_moment"] * thrust
        lift, drag = qbar * c["S/m"] * cl, qbar * c["S/m"] * cd
        rates = {
            "V": -drag + thrust / mass * jnp.cos(alpha + tilt) + G * jnp.sin(alpha - theta),
            "alpha": q + (G * jnp.cos(alpha - theta) - lift - thrust / mass * jnp.sin(alpha + tilt)) / v,
            "theta": q,
            "q": qdot,
        }
        seen = {
            "qdot": qdot,
            "ax": lift * jnp.sin(alpha) - drag * jnp.cos(alpha) + thrust / mass * np.cos(tilt),
            "az": -lift * jnp.cos(alpha) - drag * jnp.sin(alpha) - thrust / mass * np.sin(tilt),
        }
        return rates, {**x, **seen}

    columns = {"V": 4, "alpha": 5, "theta": 6, "q": 7, "qdot": 8, "ax": 9, "az": 10}
    model = DynamicModel(
        "HFB-320, longitudinal",
        ("V", "alpha", "theta", "q"),
        ("de", "thrust"),
        tuple(columns),
        tuple(reference),
        equations,
    )
    signals = Signals(
        0.1, {"de": table[:, 1], "thrust": table[:, 3]}, {n: table[:, i] for n, i in columns.items()}
    )
    kind = "filter-error" if method == "filter-error" else "output-error"
    return Case(estimate(model, [signals], None, Settings(kind)), reference, {})


def unstable(data: Path = DATA) -> Case:
    """Return a simulated aircraft whose short period grows, beside what it was simulated with."""
    table = np.loadtxt(data / "fvsysid" / "unStabAC_sim.asc")
    truth = stored("fvsysid", "unstable_aircraft", data)

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        down = p["Zw"] * x["w"] + p["Zq"] * x["q"] + p["Zde"] * u["de"]
        rates = {
            "w": down + truth["U0"] * x["q"],
            "q": p["Mw"] * x["w"] + p["Mq"] * x["q"] + p["Mde"] * u["de"],
        }
        return rates, {**x, "az": down}

    model = DynamicModel(
        "unstable", ("w", "q"), ("de",), ("w", "q", "az"), ("Zw", "Zq", "Zde", "Mw", "Mq", "Mde"), equations
    )
    step = float(table[1, 0] - table[0, 0])
    signals = Signals(step, {"de": table[:, 4]}, {"w": table[:, 2], "q": table[:, 3], "az": table[:, 5]})
    found = estimate(model, [signals], Choices(initial="measured"))
    return Case(found, {n: truth[n] for n in ("Zw", "Zq", "Mw", "Mq")}, {})


CASES: dict[str, Callable[[], Case]] = {
    "Twin Otter, time": twin_otter_in_time,
    "Twin Otter, frequency": twin_otter_on_lines,
    "F-16XL": lambda: f16xl()[1],
    "ATTAS": lambda: attas(one_start=False),
    "ATTAS, documented start": lambda: attas(one_start=True),
    "HFB-320, output error": lambda: hfb320("output-error"),
    "HFB-320, filter error": lambda: hfb320("filter-error"),
    "unstable aircraft": unstable,
}


def main() -> None:
    with open(Path(__file__).with_suffix(".csv"), "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(
            [
                "case",
                "parameter",
                "estimate",
                "std_error",
                "reference",
                "per_cent_off",
                "sigma_off",
                "error_ratio",
            ]
        )
        for case, run in CASES.items():
            result = run()
            for name, value in result.reference.items():
                estimate_, sigma = result.found[name]
                row = [
                    f"{estimate_:.6g}",
                    f"{sigma:.3g}",
                    f"{value:.6g}",
                    f"{100 * (estimate_ / value - 1):.3f}",
                ]
                if name in result.std_error:
                    published = result.std_error[name]
                    row += [f"{(estimate_ - value) / published:.2f}", f"{sigma / published:.4f}"]
                table.writerow([case, name, *row, *[""] * (6 - len(row))])
                print(case, name, *row, flush=True)
            print(case, "coloured:", *result.found.coloured, "; steps", result.found.steps, flush=True)


if __name__ == "__main__":
    main()

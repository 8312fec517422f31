"""A short period with known parameters, flown with whatever noise a test wants."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from freqid.identify.output_error.model import DynamicModel, Signals

TRUTH = {"Zw": -1.2, "Zq": 28.0, "Mw": -0.35, "Mq": -2.1, "Mde": -9.0}
DT = 0.04


def equations(x, u, p):
    rates = {
        "w": p["Zw"] * x["w"] + p["Zq"] * x["q"],
        "q": p["Mw"] * x["w"] + p["Mq"] * x["q"] + p["Mde"] * u["de"],
    }
    return rates, {"w": x["w"], "q": x["q"], "az": p["Zw"] * x["w"] + p["bias_az"]}


MODEL = DynamicModel(
    "short period", ("w", "q"), ("de",), ("w", "q", "az"), (*TRUTH, "bias_az"), equations, own=("bias_az",)
)


def elevator(samples=400):
    """Return a doublet and a slow sine, rad."""
    t = DT * np.arange(samples)
    return (
        0.05 * np.sin(0.9 * t)
        + np.where((t > 2) & (t < 3), 0.06, 0.0)
        - np.where((t >= 3) & (t < 4), 0.06, 0.0)
    )


def fly(seed=0, noise=0.0, process=0.0, samples=400, x0=(0.3, -0.02), bias=0.4, truth=TRUTH):
    """Return signals by exact discretisation, inputs linear between samples: no Runge-Kutta in it."""
    rng, de = np.random.default_rng(seed), elevator(samples)
    a = np.array([[truth["Zw"], truth["Zq"]], [truth["Mw"], truth["Mq"]]])
    whole = np.zeros((4, 4))  # state, input, slope of the input
    whole[:2, :2], whole[:2, 2], whole[2, 3] = a, [0.0, truth["Mde"]], 1.0
    step = expm(whole * DT)
    x = np.empty((samples, 2))
    x[0] = x0
    for i in range(samples - 1):
        state = np.array([*x[i], de[i], (de[i + 1] - de[i]) / DT])
        x[i + 1] = (step @ state)[:2] + process * np.sqrt(DT) * rng.normal(size=2) * [1.0, 0.03]
    outputs = {"w": x[:, 0], "q": x[:, 1], "az": truth["Zw"] * x[:, 0] + bias}
    size = {"w": 0.1, "q": 0.004, "az": 0.15}
    noisy = {n: y + noise * size[n] * rng.normal(size=samples) for n, y in outputs.items()}
    return Signals(DT, {"de": de}, noisy)

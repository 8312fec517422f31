"""Excitation, control gains and trim of a judging vehicle, from its scenario and its owner's simulation."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")


def harmonics(scenario: dict[str, Any]) -> dict[str, NDArray[np.int64]]:
    """Return the harmonic numbers of each effector, dealt out in turn."""
    low, high = scenario["excitation"]["band_hz"]
    period = scenario["excitation"]["period_s"]
    every = np.arange(round(low * period), round(high * period) + 1)
    names = list(scenario["excitation"]["amplitude"])
    return {name: every[i :: len(names)] for i, name in enumerate(names)}


def multisines(
    scenario: dict[str, Any], seeds: tuple[int, ...], time: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return random-phase multisines, shape (seed, effector, sample)."""
    period = scenario["excitation"]["period_s"]
    amplitude = scenario["excitation"]["amplitude"]
    out = np.zeros((len(seeds), len(scenario["effector"]), time.size))
    names = [e["name"] for e in scenario["effector"]]
    for k, seed in enumerate(seeds):
        rng = np.random.default_rng(seed)
        for name, own in harmonics(scenario).items():
            phase = rng.uniform(0, 2 * np.pi, own.size)
            tones = np.sin(2 * np.pi * np.outer(own, time) / period + phase[:, None])
            out[k, names.index(name)] = amplitude[name] * np.sqrt(2 / own.size) * tones.sum(axis=0)
    return out


def control_gains(scenario: dict[str, Any]) -> NDArray[np.float64]:
    """Return the control law's gains, shape (effector, state)."""
    gains = scenario["control"]["gains"]
    return np.array([[gains.get(e["name"], {}).get(x, 0.0) for x in STATES] for e in scenario["effector"]])


def load_module(path: Path) -> Any:
    """Import a Python file by its path."""
    spec = importlib.util.spec_from_file_location(f"{path.parent.name}_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def trim_of(path: Path, scenario: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the state and command at each reference as the owner's simulation trims them."""
    simulation = load_module(path)
    out = {}
    for at in scenario["reference"]:
        state, command = simulation.trim(at["u"], at["rho"])
        out[at["id"]] = {"state": np.array([*state, 100.0]), "command": np.array(command), "rho": at["rho"]}
    return out

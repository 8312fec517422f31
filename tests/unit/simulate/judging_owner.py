"""A judging vehicle's modules, its owner's coefficients made again, and his simulation along true flights."""

import importlib
import importlib.util
import math
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]


def module_of(folder: Path, name: str) -> ModuleType:
    """Return a module of a vehicle under a name of its own: all vehicles have one of the same name."""
    alone = f"judging_{folder.name}_{Path(name).name}"
    spec = importlib.util.spec_from_file_location(alone, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def campaign_again(folder: Path, into: Path, absolute: float = 1e-6) -> None:
    """Make the owner's coefficients again, into another folder, and compare them with those committed."""
    tunnel = module_of(folder, "tunnel")
    tunnel.HERE = into
    tunnel.main()
    made, committed = ((at / "tunnel.csv").read_text().splitlines() for at in (into, folder))
    assert len(made) == len(committed)
    for a, b in zip(made[1:], committed[1:], strict=True):
        (*name_a, value_a), (*name_b, value_b) = a.split(","), b.split(",")
        assert name_a == name_b
        assert float(value_a) == pytest.approx(float(value_b), rel=1e-3, abs=absolute)


def beside_truth(
    truth: ModuleType, simulation: ModuleType, count: int, settle: float, lasting: float, within: float
) -> Iterator[Array]:
    """Fly draws of all tolerances without noise, check the owner's loads, and yield what was felt.

    What varies is off by less than 5 % in every load of every flight, 3 % on the average. Means are off by
    less than `within` of what one sigma of all of the owner's parameters together makes.

    Parameters
    ----------
    truth, simulation : module
    count : int
        Draws; each is flown in all conditions.
    settle, lasting : float
        Of a flight before what is looked at, and of that, s.
    within : float

    Yields
    ------
    ndarray, shape (effector, sample)
        Positions that the air felt, of each flight.
    """
    settings, motion, scatter = (importlib.import_module(n) for n in ("settings", "motion", "scatter"))
    rng = np.random.default_rng(5)
    sigmas = scatter.per_case(truth)
    drawn = [scatter.draw(sigmas, rng) for _ in range(count)]
    flown = [(c, d) for d in drawn for c in truth.TRIM]
    rows = []

    class Watched:
        def __getattr__(self, name):
            return getattr(truth, name)

        def loads(self, x, felt, rho, s, memory):
            made = truth.loads(x, felt, rho, s, memory)
            rows.append(np.vstack([x[:6], felt, made]))
            return made

    flights = [{"condition": c, "design": 0} for c, _ in flown]
    motion.fly(Watched(), flights, settings.Settings([d for _, d in flown]), settle=settle, lasting=lasting)
    whole = np.array(rows[::8])  # at the beginning of every second step, 0.02 s apart
    kept, felt = whole.shape[0] - round(lasting / 0.02), slice(6, 6 + len(truth.EFFECTORS))
    shares = []
    for k, (condition, departures) in enumerate(flown):
        rho, series = truth.TRIM[condition]["rho"], whole[:, :, k].T
        state = dict(zip(("u", "v", "w", "p", "q", "r"), series, strict=False))
        effector = dict(zip(truth.EFFECTORS, series[felt], strict=True))
        own = {n: v for n, v in departures.items() if n in truth.TOLERANCES}
        time = 0.02 * np.arange(series.shape[1])
        said = simulation.wrench(time, state, effector, {"rho": np.full(time.size, rho)}, own)
        off = (np.array([said[n] for n in "XYZLMN"]) - series[felt.stop :])[:, kept:]
        shares.append(off.std(axis=1) / series[felt.stop :, kept:].std(axis=1))
        x, at = (series[part, kept:].mean(axis=1).tolist() for part in (slice(6), felt))
        said = np.array(simulation.loads(math, x, at, rho, own))
        moved = [
            simulation.loads(math, x, at, rho, own | {n: own[n] + s}) for n, s in truth.TOLERANCES.items()
        ]
        bar = within * np.linalg.norm(np.array(moved) - said, axis=0) + 0.02
        assert (np.abs(off.mean(axis=1)) < bar).all(), (condition, off.mean(axis=1), bar)
        yield series[felt]
    assert np.max(shares) < 0.05
    assert np.sqrt(np.mean(np.square(shares), axis=0)).max() < 0.03

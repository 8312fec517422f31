"""Files that the examples of the public API work on: an LA-8 cut down to what flies in seconds."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import freqid as fq

CONDITIONS = ("u85", "u102")
ELEVATORS = (
    '\n[[group]]\nname = "elevators"\neffectors = ["de1", "de2", "de3", "de4"]\nkind = "one linkage"\n'
)
# The shipped corridor ends at 25.9 m/s, and the example asks at 30.
FASTER = '\n[[reference]]\nid = "u102"\nu = 31.0\nrho = 1.225\ndw1 = 0.0\ndw2 = 0.0\n\n[excitation]\n'


def short_la8() -> str:
    """Return the LA-8 scenario with two conditions, half the period, and no long search for a design."""
    shipped = Path(fq.__file__).parent / "scenarios" / "la8.toml"
    text = shipped.read_text(encoding="utf-8").replace("\n[excitation]\n", FASTER, 1)
    text = re.sub(r'\[\[reference\]\]\nid = "(.*)"\n(?:.+\n)*', lambda m: m[0] * (m[1] in CONDITIONS), text)
    text = re.sub(r"(net_load|power_db|residuals) = .*\n", "", text)
    text = text.replace('allocation = "propulsors-low"', 'allocation = "interleaved"')
    text = text.replace('estimator = "instruments"', 'estimator = "least-squares"')
    return (
        re.sub(r"period_s = .*\nperiods = .*", "period_s = 30.0\nperiods = 1\nstarts = 1", text) + ELEVATORS
    )


MODEL = """
import freqid as fq

POINT = fq.read("u85.h5")
WEAK = ("de1", "de2", "de3", "de4")  # the elevators of this simulation do too little

def wrench(time, state, effector, air, parameters):
    values = {**state, **effector}
    found = {}
    for name in wrench.responses:
        r = POINT[name]
        found[name] = r.bias + sum(
            (0.4 if x in WEAK else 1.0) * slope * (values[x] - trim)
            for x, slope, trim in zip(r.regressors, r.estimate, r.trim)
        )
    return found

wrench.responses = ("Z", "M")
"""


@pytest.fixture(scope="session")
def short_flights(tmp_path_factory) -> Path:
    """Fly the short LA-8; return the folder with what the example of docs/python.md reads."""
    folder = tmp_path_factory.mktemp("la8")
    (folder / "la8.toml").write_text(short_la8(), encoding="utf-8")
    scenario = fq.read_scenario(folder / "la8.toml")
    design = fq.design_inputs(scenario, seed=0)
    for seed, at in enumerate((*CONDITIONS, "u85"), start=1):
        flown = fq.simulate(scenario, design, at=at, noise=0.3, seed=seed)
        fq.save(flown, folder / f"flight{seed}.h5")
        if seed <= len(CONDITIONS):
            fq.save(fq.identify_point(flown.record, scenario), folder / f"{at}.h5")
    flight = fq.read(folder / "flight1.h5")
    columns = {"time": flight.time} | {n: c.values for n, c in flight.channels.items()}
    pd.DataFrame(columns).to_csv(folder / "flight.csv", index=False)
    rows = ['[time]\ncolumn = "time"\nunit = "s"\n']
    for name, channel in flight.channels.items():
        where = f"position_m = {list(channel.position_m)}\n" if channel.position_m else ""
        rows.append(f'[[channel]]\nname = "{name}"\ncolumn = "{name}"\nunit = "{channel.unit}"\n{where}')
    (folder / "columns.toml").write_text("\n".join(rows), encoding="utf-8")
    (folder / "model.py").write_text(MODEL, encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def linear(linear_logs, tmp_path_factory) -> dict[str, Any]:
    """Names that the examples of the docstrings use: an aircraft of known derivatives, in a folder."""
    folder = tmp_path_factory.mktemp("examples")
    project = Path(fq.__file__).resolve().parents[1]
    shutil.copy(linear_logs["noisy"], folder / "flight.csv")
    shutil.copy(project / "scenarios" / "maps" / "linear.toml", folder / "columns.toml")
    scenario = fq.read_scenario(project / "scenarios" / "linear.toml")
    columns = folder / "columns.toml"
    flight = fq.read_log(folder / "flight.csv", columns=columns, scenario=scenario, at="u20")
    model = fq.identify_point(flight, scenario)
    other = fq.read_log(linear_logs["clean"], columns=columns, scenario=scenario, at="u20")
    return {"folder": folder, "scenario": scenario, "flight": flight, "other": other, "model": model}

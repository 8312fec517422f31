"""Stages of a campaign that identify, blend and diagnose; the oracles are the aircraft's coefficients."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_up_gap import made_up

import freqid as fq

PROJECT = Path(__file__).resolve().parents[2]
SPEEDS = (18, 20, 22)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The linear aircraft of the examples at three conditions, with inputs of 24 s."""
    at = tmp_path_factory.mktemp("campaigns")
    text = (PROJECT / "scenarios" / "linear.toml").read_text()
    for old, new in (
        ("period_s = 60.0\nperiods = 2", "period_s = 24.0\nperiods = 1"),
        ("band_hz = [0.05, 1.8]", "band_hz = [0.1, 1.8]"),
        (
            '[[reference]]\nid = "u20"\nu = 20.0\nrho = 1.225\n',
            "".join(f'[[reference]]\nid = "u{u}"\nu = {u}.0\nrho = 1.225\n' for u in SPEEDS),
        ),
    ):
        assert old in text
        text = text.replace(old, new)
    (at / "s.toml").write_text(text)
    return at


def ran(folder, name, text, **how):
    """Run a campaign; return its result and its rows as a user reads them."""
    path = folder / f"{name}.toml"
    path.write_text(f'scenario = "s.toml"\n{text}')
    found = fq.monte_carlo(path, folder / name, jobs=1, **how)
    return found, pd.read_parquet(folder / name / "rows")


def coefficients(folder):
    """Return what the aircraft flies by, per response and regressor."""
    table = tomllib.loads((folder / "s.toml").read_text())["simulation"]["coefficients"]
    found = {f"{r}.{x}": table[r][x] for r in "XYZLMN" for x in table[r] if x != "bias"}
    for name in found:  # the axes are the body's: what is stated is what a flight tells
        assert name.partition(".")[2] in {"u", "v", "w", "p", "q", "r", "de", "da", "dr", "n1"}
    return pd.Series(found)


def test_identify_says_what_the_same_flight_says_and_that_is_the_aircraft(folder):
    found, rows = ran(
        folder,
        "identify",
        'stage = "identify"\nseeds = 2\nbatch = 2\nby = "estimator"\n[fixed]\nat = "u20"\n'
        '[vary]\nnoise = [0.0, 1.0]\nestimator = ["least-squares", "instruments"]\n',
    )
    assert (found.cases, found.failed, found.axis) == (8, 0, "noise")
    truth = coefficients(folder)
    flown = rows[rows.quantity.isin(truth.index)]
    assert set(flown.quantity) == set(truth.index)
    scale = {r: np.abs(truth[truth.index.str.startswith(r)]).max() for r in "XYZLMN"}
    error = flown.reference - flown.quantity.map(truth)
    assert (error.abs() / flown.quantity.str[0].map(scale)).max() < 0.02  # no sensor errors, no linear loss
    still = rows[(rows.noise == 0.0) & (rows.estimator == "least-squares")]
    assert np.array_equal(still.estimate, still.reference)  # the same estimator on the same flight
    assert (rows.r2[rows.noise == 0.0] > 0.95).all()
    noisy = rows[rows.noise == 1.0]
    assert (noisy.estimate != noisy.reference).all()
    for name, own in noisy.groupby("estimator"):
        (coverage,) = [m for m in found.of("coverage", curve=name) if m.at == 1.0]
        assert coverage.mean == pytest.approx(((own.lo <= own.reference) & (own.reference <= own.hi)).mean())
    # one case by hand: the same flight, identified by the public functions
    scenario = fq.read_scenario(folder / "s.toml")
    flight = fq.simulate(scenario, fq.design_inputs(scenario, seed=0).design, at="u20", noise=1.0, seed=1)
    model = fq.identify_point(flight.record, scenario, at="u20", estimator="least-squares")
    own = noisy[(noisy.seed == 1) & (noisy.estimator == "least-squares")].set_index("quantity")
    for name in truth.index:
        response, _, regressor = name.partition(".")
        assert own.estimate[name] == pytest.approx(model[response][regressor][0], rel=1e-9)
        assert own.std_error[name] == pytest.approx(model[response][regressor][1], rel=1e-9)


def test_blend_is_judged_at_the_condition_that_is_held_out(folder):
    found, rows = ran(
        folder,
        "blend",
        'stage = "blend"\nseeds = 1\n[fixed]\nat = ["u18", "u20", "u22"]\nheld_out = "u20"\n'
        "[vary]\nnoise = [0.0, 1.0]\n",
    )
    assert (found.cases, found.failed) == (2, 0)
    truth = coefficients(folder)
    assert set(truth.index) <= set(rows.quantity)
    own = rows[rows.quantity.isin(truth.index)].copy()
    own["off"] = own.estimate - own.quantity.map(truth)
    scale = own.quantity.str[0].map(lambda r: np.abs(truth[truth.index.str.startswith(r)]).max())
    assert (own.off.abs() / scale)[own.noise == 0.0].max() < 0.05  # the aircraft is one at all speeds
    assert ((own.reference - own.quantity.map(truth)).abs() / scale).max() < 0.05
    assert not np.array_equal(own.estimate[own.noise == 0.0], own.estimate[own.noise == 1.0])
    assert {m.at for m in found.of("coverage")} == {0.0, 1.0}
    scenario = fq.read_scenario(folder / "s.toml")
    design = fq.design_inputs(scenario, seed=0).design
    points = []
    for k, at in enumerate(("u18", "u22")):  # the second flight of a case has other noise
        flight = fq.simulate(scenario, design, at=at, noise=1.0, seed=1000 * k)
        points.append(fq.identify_point(flight.record, scenario, at=at))
    either = [p["M"]["de"][0] for p in points]
    noisy = rows[rows.noise == 1.0].set_index("quantity")
    assert min(either) < noisy.estimate["M.de"] < max(either)
    assert noisy.estimate["M.de"] == pytest.approx(np.mean(either), abs=0.1 * abs(np.diff(either)).item())
    model = fq.blend(points)
    more, less = (model.wrench(u=20.0, de=de).values[model.names.index("M")] for de in (0.06, 0.05))
    by_hand = (more - less).item() / 0.01
    assert noisy.estimate["M.de"] == pytest.approx(by_hand, rel=1e-6)


def test_diagnose_hands_over_the_flight_with_the_effect_and_says_what_was_found(folder, monkeypatch):
    """A whole diagnosis takes half a minute, so what it finds is made up here; what it is asked is not."""
    from freqid.workflows import diagnose

    asked = []

    def diagnosed(simulation, flights, **how):
        asked.append((simulation, flights, how))
        lost = fq.identify_point(flights[0], how["scenario"], at="u20")["M"]["de"][0] > -30.0
        gap = made_up(exists=lost)
        if how["seed"] == 1:  # another name than that of the effect that is there
            return replace(gap, diagnosis=replace(gap.diagnosis, which=replace(gap.which, named=("stall",))))
        which = replace(gap.which, set=("surface_effectiveness",), named=("surface_effectiveness",))
        return replace(gap, diagnosis=replace(gap.diagnosis, which=which))

    monkeypatch.setattr(diagnose, "diagnose_gap", diagnosed)
    found, rows = ran(
        folder,
        "diagnose",
        'stage = "diagnose"\nseeds = 2\nbatch = 2\naxis = "effects.surface_effectiveness.de"\n[fixed]\n'
        'at = "u20"\ndraws = 100\nlevel = 0.05\ntolerance.mass = 0.01\n'
        "[vary.effects.surface_effectiveness]\nde = [0.0, 0.5]\n",
    )
    assert (found.cases, found.rows, found.failed) == (4, 4, 0)
    assert all(len(flights) == 1 for _, flights, _ in asked)
    assert len({id(simulation) for simulation, _, _ in asked}) == 1
    assert all((how["level"], how["draws"]) == (0.05, 100) for _, _, how in asked)
    assert all(how["tolerances"] == {"mass": 0.01} for _, _, how in asked)
    without = asked[0][0].scenario if hasattr(asked[0][0], "scenario") else None
    assert without is None or not without.simulation.effects  # what is compared with has no effect
    rows = rows.set_index(["effects.surface_effectiveness.de", "seed"]).sort_index()
    assert rows.present.tolist() == rows.called.tolist() == [False, False, True, True]
    assert rows.named[0.5].tolist() == ["surface_effectiveness", "stall"]
    assert rows.right[0.5].tolist() == rows.in_set[0.5].tolist() == [True, False]
    assert rows.right[0.0].isna().all()
    assert rows["drawn.mass"].nunique() == 2  # one a seed, the same aircraft with and without the loss
    assert [(m.at, m.mean) for m in found.of("detection")] == [(0.5, 1.0)]
    assert [(m.at, m.mean) for m in found.of("alarm")] == [(0.0, 0.0)]
    assert [(m.at, m.mean) for m in found.of("right")] == [(0.5, 0.5)]
    assert "Campaign of 4 cases" in fq.page(found).html


def test_a_flight_that_fails_keeps_its_draws_and_the_columns_of_others(folder):
    """A folder is read with the columns of its first file, which may be one of failures alone."""
    found, rows = ran(
        folder,
        "failing",
        'stage = "identify"\nseeds = 1\n[fixed]\nat = "u20"\ntolerance.mass = 0.01\n'
        "[vary]\nduration = [0.5, 24.0]\n",
    )
    assert (found.cases, found.failed) == (2, 1)
    failed = rows[rows.failure.notna()]
    assert failed.duration.tolist() == [0.5]
    assert failed["drawn.mass"].item() == rows["drawn.mass"].iloc[-1]
    assert {"r2", "p", "in_set", "unit"} <= set(rows.columns)
    for path in (folder / "failing" / "rows").glob("*.parquet"):
        assert not any(str(t) == "null" for t in _types(path))


def _types(path):
    import pyarrow.parquet as pq

    return pq.read_schema(path).types

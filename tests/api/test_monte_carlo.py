"""Monte Carlo campaigns: what is done, kept, summed up and shown; the oracles count rows by hand."""

import json
import math
import textwrap
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.core.errors import FreqidError, UsageError
from freqid.core.results.judged.monte_carlo import wilson
from freqid.simulate.effects import library
from freqid.workflows.monte_carlo.plan import flat, nested, read_plan
from freqid.workflows.monte_carlo.rows import summary_of, write_rows
from freqid.workflows.monte_carlo.stages import Case

PROJECT = Path(__file__).resolve().parents[2]
OWN = """
    import os
    from pathlib import Path
    import numpy as np
    from freqid.core.errors import DataError

    def trial(seed, *, size, level, log=""):
        if log:
            with open(log, "a") as file:
                file.write(f"{seed} {size} {level}\\n")
        if seed == 3 and size == 1.0:
            raise DataError("the aircraft diverged", remedy="lower the inputs")
        rng = np.random.default_rng([seed, int(10 * size)])
        error = rng.standard_normal(4) + 0.3 * rng.standard_normal()
        return {
            "quantity": ["a", "b", "c", "d"],
            "estimate": size + error,
            "std_error": np.ones(4),
            "lo": size + error - 1.96,
            "hi": size + error + 1.96,
            "reference": np.full(4, size),
            "present": size > 0,
            "called": abs(error.mean() + size) > 0.5 + level,
        }

    def wrong(seed, *, size, level):
        return {"size": 1.0}
"""
PLAN = """
    stage = "own.py:trial"
    seeds = 12
    batch = 5
    [vary]
    size = [0, 0.5, 1.0]
    level = [0.1, 0.2]
"""


@pytest.fixture
def campaign(tmp_path):
    """Return what writes a campaign, with the changes given, and its function."""

    def write(*changes, extra=""):
        text = textwrap.dedent(PLAN)
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "own.py").write_text(textwrap.dedent(OWN))
        (tmp_path / "c.toml").write_text(text + extra)
        return tmp_path / "c.toml"

    return write


def rows_of(folder):
    return pd.read_parquet(folder / "rows")


def test_measures_are_those_that_counting_the_rows_gives(campaign, tmp_path):
    found = fq.monte_carlo(campaign(), tmp_path / "out", by="level", jobs=1)
    rows = rows_of(tmp_path / "out")
    assert (found.cases, found.rows, found.failed, found.axis) == (72, len(rows), 2, "size")
    ((why, count),) = found.failures.items()
    assert why.startswith("the aircraft diverged")
    assert count == 2
    assert set(rows.columns) >= {"size", "level", "seed", "quantity", "estimate", "failure"}
    assert rows["size"].dtype == float  # as a value of the axis is no integer
    assert len(rows) == 70 * 4 + 2
    for at in (0.0, 0.5, 1.0):
        for curve in (0.1, 0.2):
            own = rows[(rows["size"] == at) & (rows["level"] == curve) & rows["failure"].isna()]
            (coverage,) = [m for m in found.of("coverage", curve=str(curve)) if m.at == at]
            held = (own.lo <= own.reference) & (own.reference <= own.hi)
            assert coverage.mean == pytest.approx(held.mean(), rel=1e-12)
            assert (coverage.count, coverage.cases) == (len(own), own.seed.nunique())
            (bias,) = [m for m in found.of("bias", curve=str(curve)) if m.at == at]
            by_case = own.assign(z=own.estimate - own.reference).groupby("seed").z.mean()
            assert bias.mean == pytest.approx(by_case.mean(), rel=1e-12)
            half = (
                1.96 * by_case.std(ddof=1) / math.sqrt(len(by_case))
            )  # rows of one case are not independent
            assert bias.hi - bias.mean == pytest.approx(half, rel=1e-9)
            (scatter,) = [m for m in found.of("scatter", curve=str(curve)) if m.at == at]
            assert scatter.mean == pytest.approx(((own.estimate - own.reference) ** 2).mean() ** 0.5)
            (one,) = [m for m in found.of("coverage", "b", str(curve)) if m.at == at]
            assert one.mean == pytest.approx(held[own.quantity == "b"].mean())
            kind = "detection" if at else "alarm"
            (called,) = [m for m in found.of(kind, curve=str(curve)) if m.at == at]
            assert called.mean == pytest.approx(own.called.astype(float).mean())
            # four equal rows a case: the interval is that of the cases
            share, n = called.mean, called.cases
            assert (called.lo, called.hi) == pytest.approx(wilson(share * n, n), abs=0.02)
    assert not [m for m in found.of("alarm") if m.at]
    assert not [m for m in found.of("detection") if not m.at]
    again = fq.read(tmp_path / "out" / "campaign.h5")
    assert again == found
    assert set(found.to_frame()["measure"]) == {*found.measures}


def test_wilson_is_that_of_published_tables():
    # R. G. Newcombe, Statistics in Medicine 17, 857 (1998), table I, method 3
    for (hits, count), expected in {
        (81, 263): (0.2553, 0.3662),
        (15, 148): (0.0624, 0.1605),
        (0, 20): (0.0, 0.1611),
        (1, 29): (0.0061, 0.1718),
    }.items():
        assert wilson(hits, count) == pytest.approx(expected, abs=1.1e-4)


def test_nothing_is_done_twice_and_an_axis_or_more_seeds_change_nothing_of_it(campaign, tmp_path):
    log = f'\n[fixed]\nlog = "{tmp_path / "log"}"\n'

    def done():
        return len((tmp_path / "log").read_text().splitlines())

    first = fq.monte_carlo(campaign(extra=log), tmp_path / "out", jobs=1)
    assert done() == 72
    other = fq.monte_carlo(tmp_path / "c.toml", tmp_path / "out", axis="level", by="size", jobs=1)
    assert done() == 72
    assert (first.axis, other.axis, other.axis_values) == ("size", "level", [0.1, 0.2])
    more = fq.monte_carlo(campaign(("seeds = 12", "seeds = 20"), extra=log), tmp_path / "out", jobs=1)
    assert more.cases == 120
    assert done() == 72 + 6 * (20 - 10)  # the third batch held two seeds and holds five now
    assert [tuple(s) for s in json.loads((tmp_path / "out" / "parts.json").read_text())]
    (tmp_path / "own.py").write_text((tmp_path / "own.py").read_text() + "\n# another function\n")
    fq.monte_carlo(tmp_path / "c.toml", tmp_path / "out", jobs=1)
    assert done() == 72 + 60 + 120


def test_two_processes_and_a_cluster_give_what_one_gives(campaign, tmp_path):
    pytest.importorskip("distributed")
    path = campaign()
    every = {
        name: fq.monte_carlo(path, tmp_path / name, **how)
        for name, how in {"one": {"jobs": 1}, "two": {"jobs": 2}, "cluster": {"workers": 2}}.items()
    }
    assert every["one"] == every["two"] == every["cluster"]
    keys = ["size", "level", "seed", "quantity"]
    tables = [rows_of(tmp_path / n).sort_values(keys).reset_index(drop=True) for n in every]
    for other in tables[1:]:
        pd.testing.assert_frame_equal(tables[0], other, check_exact=True)


@pytest.mark.parametrize(
    ("changes", "extra", "said"),
    [
        ([("size = [0, 0.5, 1.0]", "size = 1")], "", "vary.size is 1, expected a list"),
        ([("size = [0, 0.5, 1.0]", 'size = [0, "a"]')], "", "vary.size mixes values of several types"),
        ([("size = [0, 0.5, 1.0]", "size = [1, 1.0]")], "", "vary.size has a value twice"),
        ([("seeds = 12", "seeds = 0")], "", "seeds is 0"),
        ([("seeds = 12", 'axis = "sise"')], "", "axis 'sise' does not vary"),
        ([], "[fixed]\nsize = 1\n", "'size' is both fixed and varied"),
        ([("own.py:trial", "own.py:trail")], "", "has no function 'trail'"),
        ([("own.py:trial", "none.py:trial")], "", "file of the stage cannot be read"),
        ([("own.py:trial", "identifi")], "", "stage 'identifi' is unknown"),
        ([("own.py:trial", "identify")], "", "stage 'identify' needs a scenario"),
        ([('"own.py:trial"', '"identify"\nscenario = "la8"')], "", "stage 'identify' has no setting 'level'"),
        ([("own.py:trial", "own.py:wrong")], "", "column 'size', which is a setting"),
    ],
)
def test_what_cannot_be_done_is_said(campaign, tmp_path, changes, extra, said):
    with pytest.raises(FreqidError, match=said):
        fq.monte_carlo(campaign(*changes, extra=extra), tmp_path / "out", jobs=1)


def test_settings_are_tables_and_effects_and_tolerances_are_drawn(tmp_path):
    table = {"effects": {"mass": 0.05, "surface_effectiveness": {"de": 0.0}}, "at": "u20"}
    assert nested(flat(table)) == table
    scenario = fq.read_scenario(PROJECT / "scenarios" / "linear.toml")
    setting = {"effects": {"mass": 0.0}, "tolerance": {"mass": 0.02, "sensor_bias": {"p": 0.001}}}
    cases = [Case(scenario, {}, seed, setting) for seed in range(400)]
    assert not any(case.present for case in cases)
    drawn = pd.DataFrame([case.drawn for case in cases])
    assert drawn.std()["mass"] == pytest.approx(0.02, rel=0.12)
    assert drawn.std()["sensor_bias.p"] == pytest.approx(0.001, rel=0.12)
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 0.15
    size = library()["mass"].size
    assert cases[0].flown.simulation.effects["mass"][size] == pytest.approx(drawn["mass"][0])
    heavier = Case(scenario, {}, 0, {**setting, "effects": {"mass": 0.1}})
    assert heavier.present
    assert heavier.flown.simulation.effects["mass"][size] == pytest.approx(0.1 + drawn["mass"][0])


def test_a_stage_of_freqid_is_flown_and_its_rows_carry_what_was_drawn(tmp_path, monkeypatch):
    path = tmp_path / "c.toml"
    path.write_text(
        'stage = "fly"\nscenario = "la8"\nseeds = 1\n[fixed]\nat = "u45"\nduration = 1.0\n'
        "tolerance.mass = 0.01\n[vary]\nnoise = [0, 1.0]\n"
    )
    from freqid.workflows.monte_carlo import run

    monkeypatch.setattr(run, "_designs", lambda *_: {})  # no inputs: the condition is held
    found = fq.monte_carlo(path, tmp_path / "out", jobs=1)
    rows = rows_of(tmp_path / "out")
    assert found.failed == 0
    assert set(rows.quantity) >= {"u", "w", "q", "theta"}
    drawn = rows.groupby("noise")["drawn.mass"].first()
    assert drawn.nunique() == 1  # the same seed, the same aircraft
    values = {m.quantity: m.mean for m in found.measured if m.measure == "value" and m.at == 1.0}
    assert values["q"] == pytest.approx(rows[(rows.quantity == "q") & (rows.noise == 1.0)].value.item())
    assert "Campaign of 2 cases" in fq.page(found).html


def test_memory_holds_one_unit_at_a_time(tmp_path, monkeypatch):
    """Rows of each unit are taken in and dropped before the next is read."""
    import weakref

    import pyarrow.parquet as pq

    for i in range(4):
        write_rows(tmp_path / f"{i}.parquet", {"x": float(i)}, [(s, {"value": 1.0}) for s in range(50)])
    alive, most = [], []
    read = pq.ParquetFile.read

    def counted(self, *args, **kwargs):
        table = read(self, *args, **kwargs)
        alive.append(weakref.ref(table))
        most.append(sum(one() is not None for one in alive))
        return table

    monkeypatch.setattr(pq.ParquetFile, "read", counted)
    found = summary_of([tmp_path / f"{i}.parquet" for i in range(4)], "x")
    assert found.cases == 200
    assert max(most) <= 2


def test_a_plan_says_how_much_it_is(campaign):
    planned = read_plan(campaign())
    assert (planned.setting_count, planned.case_count, planned.axis) == (6, 72, "size")
    assert [len(b) for b in planned.plan.batches] == [5, 5, 2]
    with pytest.raises(UsageError, match="makes the curves too"):
        read_plan(campaign(), axis="size", by="size")

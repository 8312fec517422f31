"""The calibration that ships, and where it says that it does not hold."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from freqid.core.channels import WRENCH
from freqid.gap import calibration
from freqid.gap.tolerance import DEFAULT

ROWS = (*WRENCH, "kinematic/u")


def flown(*, kind="scenario", rows=ROWS, inputs=("d1",), duration=60.0):
    kinds = {name: "kinematic" if "/" in name else "response" for name in rows}
    return SimpleNamespace(
        trial=SimpleNamespace(simulation=SimpleNamespace(kind=kind)),
        lines=SimpleNamespace(inputs=inputs),
        maneuver=SimpleNamespace(record=SimpleNamespace(duration=duration)),
        rows=[SimpleNamespace(name=name, kind=kinds[name]) for name in rows],
    )


def test_what_ships_is_whole():
    known = calibration.shipped()
    assert known.version >= 1
    assert known.cases
    assert known.made_by.startswith("python benchmarks/")
    assert known.table.calibrated
    assert str(known.version) in known.table.source
    assert 0 < known.table.set_level <= 1


def test_inside_the_domain_the_table_is_calibrated():
    table, why = calibration.table_for([flown(), flown()], DEFAULT)
    assert table.calibrated
    assert not why


@pytest.mark.parametrize(
    ("manoeuvres", "said"),
    [
        ([flown(kind="callable")] * 2, "other kinds than 'callable'"),
        ([flown()], "manoeuvres, not 1"),
        ([flown(), flown(inputs=())], "injected signals"),
        ([flown(), flown(duration=5.0)], "not 5 s"),
        ([flown(rows=("X", "M", "kinematic/u"))] * 2, "L N Y Z too"),
        ([flown(rows=WRENCH)] * 2, "specific forces"),
    ],
)
def test_elsewhere_it_is_not_and_says_why(manoeuvres, said):
    table, why = calibration.table_for(manoeuvres, DEFAULT)
    assert not table.calibrated
    assert said in why
    assert table.set_level == calibration.shipped().table.set_level


def test_other_tolerances_are_outside():
    _, why = calibration.table_for([flown(), flown()], {**DEFAULT, "mass": 0.05})
    assert "tolerance mass of 0.01, not 0.05" in why

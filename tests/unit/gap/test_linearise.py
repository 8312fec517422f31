"""Lines where all that is unknown is likeliest: what tolerances and offsets make together is in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from linear_flight import INPUTS, LIBRARY, RESPONSES, SLOPES, TRIM, U0, W0, Linear, Truth, fly

from freqid.gap.diagnose import Question, diagnose
from freqid.gap.infer.linearise import settled
from freqid.gap.simulation import Tolerance
from freqid.simulate.effects import shipped

MORE = 0.2  # by which elevators do more than the simulation says, two sigmas
OFFSETS = (  # rad, by flight: one and a half sigmas of their sensors, which feel it through these elevators
    {"effector/d1": 0.015, "effector/d2": -0.01},
    {"effector/d1": -0.012, "effector/d2": 0.015},
)
TOLERANCES = {"elevators": 0.1, "sensor_bias.surface": 0.01}


@dataclass(frozen=True, eq=False)
class Uncertain(Linear):
    """Linear loads whose elevators' slopes are known to ten per cent."""

    tolerances: Mapping[str, Tolerance] = field(
        default_factory=lambda: {"elevators": Tolerance(TOLERANCES["elevators"], "1")}
    )

    def predict(self, record, effects=None, departures=None):
        slopes = self.slopes(effects)
        slopes[:, 3:] *= 1 + (departures or {}).get("elevators", 0.0)
        moved = record.matrix(INPUTS) - np.array([U0, W0, 0.0, 0.0, 0.0])[:, None]
        return (TRIM[:, None] + slopes @ moved)[[RESPONSES.index(r) for r in self.responses]]

    def sensitivity(self, record, sizes, departures=None):
        at = (departures or {}).get("elevators", 0.0)
        sides = [self.predict(record, None, {"elevators": at + s * sizes["elevators"]}) for s in (1, -1)]
        return [(sides[0] - sides[1]) / 2]


def diagnosed(slopes, library, tolerances):
    truth = Truth(slopes=tuple(map(tuple, slopes.tolist())))
    flights = [
        fly(truth, noise=1.0, seed=10 + k, phases=k + 1, duration=40.0, add=OFFSETS[k]) for k in (0, 1)
    ]
    return diagnose(Uncertain(), flights, Question(library, tolerances, (0.1, 2.0), draws=100, close=False))


@pytest.fixture(scope="module")
def slopes():
    more = SLOPES.copy()
    more[:, 3:] *= 1 + MORE
    return more


@pytest.fixture(scope="module")
def found(slopes):
    return diagnosed(slopes, LIBRARY, TOLERANCES)


def test_an_offset_that_is_felt_through_a_tolerance_is_no_gap(found):
    """The sum of what each makes alone leaves a hundred times the noise in the mean moment."""
    assert not found.diagnosis.gap.exists
    assert found.diagnosis.gap.p > 0.1


def test_tolerances_and_offsets_come_out_together(found):
    system, form = found.system, found.evidence.form_error()
    fitted = system.likeliest_tolerances(system.tolerance_rows(form), np.zeros(system.columns))
    assert fitted == pytest.approx([MORE / TOLERANCES["elevators"]], abs=0.1)
    for c, offsets in zip(found.columns, OFFSETS, strict=True):
        left = c.residual - fitted @ c.tolerances
        own = dict(zip(c.own_names, c.likeliest_own(left, form), strict=True))
        for name, x in offsets.items():
            each = own[f"offset.{name.partition('/')[2]}"] + own["offset.every surface"]
            assert each * TOLERANCES["sensor_bias.surface"] * np.sqrt(0.5) == pytest.approx(x, abs=5e-4)
        left = left - np.array(list(own.values())) @ c.own
        assert left @ left < 1.3 * left.size


def test_lines_that_have_settled_stay(found):
    form = found.evidence.form_error()
    alone = replace(found.system.of([]), form_errors=(form,), _reduced={})
    parts = [replace(c, effects=c.effects[:0]) for c in found.columns]
    before = alone.reduced(form).log_evidence
    again, _ = settled(alone, parts, found.blocks, LIBRARY, TOLERANCES, form, [])
    assert again.reduced(form).log_evidence == pytest.approx(before, abs=1.0)


def test_where_a_fit_asks_for_a_body_that_cannot_be_all_else_is_still_asked_for_together(slopes):
    """With 30 % less of its inertia in pitch, the aircraft would have more in yaw than in pitch and roll."""
    lighter = slopes / np.array([[1.0], [1.0], [0.7]])
    found = diagnosed(lighter, LIBRARY | {"inertia": shipped()["inertia"]}, TOLERANCES | {"inertia.yy": 0.15})
    assert not found.diagnosis.gap.exists
    fitted = found.system.likeliest_tolerances(
        found.system.tolerance_rows(found.evidence.form_error()), np.zeros(found.system.columns)
    )
    assert dict(zip(found.system.tolerances, fitted, strict=True))["inertia.yy"] == pytest.approx(-2, abs=0.3)

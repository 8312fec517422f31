"""Lines where all that is unknown is likeliest: what tolerances and offsets make together is in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from linear_flight import INPUTS, LIBRARY, RESPONSES, SLOPES, TRIM, U0, W0, Linear, Truth, fly
from msgspec.structs import replace as changed

from freqid.core.record import Maneuver
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.infer.build import build
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.linearise import Linearised
from freqid.gap.infer.together import Point
from freqid.gap.simulation import Tolerance
from freqid.gap.stack.block import stack_of
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects import shipped
from freqid.simulate.effects.signals import logged_late

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
    fitted = system.likeliest_tolerances(form, np.zeros(system.columns))
    assert fitted == pytest.approx([MORE / TOLERANCES["elevators"]], abs=0.1)
    for c, offsets in zip(found.columns, OFFSETS, strict=True):
        left = c.residual - fitted @ c.tolerances
        own = dict(zip(c.own_names, c.likeliest_own(left, form), strict=True))
        for name, x in offsets.items():
            each = own[f"offset.{name.partition('/')[2]}"] + own["offset.every surface"]
            assert each * TOLERANCES["sensor_bias.surface"] * np.sqrt(0.5) == pytest.approx(x, abs=5e-4)
        left = left - np.array(list(own.values())) @ c.own
        assert left @ left < 1.3 * left.size


def test_own_parameters_are_drawn_anew_as_their_tolerances_are(found):
    """What one makes where the simulation is asked for it alone, on the motion as it is drawn."""
    at, _ = build(found.blocks, {}, TOLERANCES)
    (own,) = [i for i, c in enumerate(at.system.candidates) if c.place.label == "elevators"]
    none = replace(at.system.candidates[own], columns=[])
    forgotten = [none if i == own else c for i, c in enumerate(at.system.candidates)]
    drawn = replace(at, system=replace(at.system, candidates=forgotten)).redrawn([own]).system.candidates[own]
    for block, (column,) in zip(at.blocks, drawn.columns, strict=True):
        ((_, made),) = block.drawn.departing({"elevators": float(drawn.sizes[0])})
        np.testing.assert_allclose(column, block.transform(made), rtol=1e-9, atol=1e-12)


def without_effects(found):
    at = Linearised(found.system, found.columns, found.blocks, LIBRARY, TOLERANCES).without_effects()
    about = found.system.of([]).about
    system = replace(at.system, form_errors=(found.evidence.form_error(),), about=about)
    return replace(at, system=system)


def test_lines_that_have_settled_stay(found):
    alone, form = without_effects(found), found.evidence.form_error()
    before = alone.system.reduced(form).log_evidence
    again = alone.settled(form, [])
    assert again.system.reduced(form).log_evidence == pytest.approx(before, abs=1.0)


@pytest.mark.parametrize("sigmas", [-4.0, 5.0])
def test_a_round_ends_where_the_data_are_likelier(found, sigmas):
    form = found.evidence.form_error()
    at = without_effects(found).at(np.array([sigmas]), [], form)
    before = at.system.about.misfit
    at = at.likelier(form, [])
    assert at.system.about.misfit < before - 100
    assert at.system.about.tolerances == pytest.approx([MORE / TOLERANCES["elevators"]], abs=0.3)
    again = at.likelier(form, [])
    assert again.system.about.misfit <= at.system.about.misfit


def test_an_effect_and_the_tolerance_of_its_parameter_are_drawn_on_the_same_motion(slopes):
    """Else what lies between the two would be free, and be taken for an effect."""
    library = LIBRARY | {"sensor_scale": shipped()["sensor_scale"]}
    found = diagnosed(slopes, library, TOLERANCES | {"sensor_scale.surface": 0.01})
    system = found.system
    (place,) = [i for i, c in enumerate(system.candidates) if c.tolerance == "sensor_scale.surface"]
    at, row = system.columns_of(place), system.tolerances.index("sensor_scale.surface")
    drawn = Linearised(system, found.columns, found.blocks, library, TOLERANCES).redrawn([place])
    for new, old in zip(drawn.columns, found.columns, strict=True):
        assert alike(new.effects[at][0], old.tolerances[row]) > 1 - 1e-9
        assert alike(old.effects[at][0], old.tolerances[row]) < 1 - 1e-7  # on motion with the offsets


def alike(one, other):
    return abs(one @ other) / np.sqrt((one @ one) * (other @ other))


@pytest.mark.parametrize("more", [0.0, 0.15])
def test_what_late_gyros_and_another_inertia_make_together_is_undone(more):
    """Moments of inertia act on the motion as it was, not on the late one."""
    flown = fly(noise=0.1, seed=4, phases=2, duration=40.0)
    record, age, stated = flown.record, 0.06, flown.vehicle.mass_properties
    late = record.channel("state/q")
    late = replace(late, values=logged_late(late.values, record.dt, age))
    less = changed(stated.inertia, yy=stated.inertia.yy / (1 + more))
    light = changed(flown.vehicle, mass_properties=changed(stated, inertia=less))
    logged = Maneuver(record.with_channels(late), light)
    (block,) = stack_of(Linear(), [logged], ["late"], (0.1, 2.0))
    effects = [("time_skew", {"rates": age}), ("inertia", {"yy": more})]
    point = Point(effects=[(shipped()[n].of(light), x) for n, x in effects])
    left = block.white(block.residual - point.made(block))
    punctual = block.white(block.lines.transform(Trial.of(Linear(), flown).residual))
    assert np.abs(block.white(block.residual) - punctual).max() > 50
    assert np.abs(left - punctual).max() < 3


def test_what_is_felt_late_and_logged_late_is_as_it_seems():
    """What sensors did is seen through what acts: the sum of what each makes bends by the square of both."""
    flown = fly(noise=0.1, seed=4, phases=2, duration=40.0)
    (block,) = stack_of(Linear(actuators=False), [flown], ["late"], (0.1, 2.0))
    late = [("actuator_delay", {"extra": 0.06}), ("time_skew", {"effectors": 0.06})]
    effects = [(shipped()[n].of(flown.vehicle), x) for n, x in late]
    each = [np.abs(block.white(Point(effects=[one]).made(block))).max() for one in effects]
    added = block.white(sum(Point(effects=[one]).made(block) for one in effects))
    assert min(*each, np.abs(added).max()) > 1000
    # a shift between samples is a little less than that of the record
    assert np.abs(block.white(Point(effects=effects).made(block))).max() < 50


def test_a_search_that_settled_about_another_effect_begins_again_without_one(monkeypatch):
    """Gyros that are 11 sigmas late, and a search that took all other channels for early."""
    flights = []
    for seed in (1, 2):
        flight = fly(noise=1.0, seed=seed, phases=seed, duration=40.0)
        gyro = flight.record.channel("state/q")
        late = replace(gyro, values=logged_late(gyro.values, flight.record.dt, 0.033))
        flights.append(replace(flight, record=flight.record.with_channels(late)))
    library = {"time_skew": shipped()["time_skew"].of(flights[0].vehicle)}
    blocks = stack_of(Linear(), flights, ["one", "other"], (0.1, 2.0))
    at, _ = build(blocks, library, {"time_skew": 0.003})
    places = {c.place.label: i for i, c in enumerate(at.system.candidates)}
    early = joint_estimates(at.system, [places["effectors"]])[0]
    early = replace(early, size=np.array([-0.03]))
    settled = Linearised.settled

    def search(self, form_error, acting=None):
        if acting is None and self is at:
            tolerances = np.array([-10.0 * (n != "time_skew.rates") for n in at.system.tolerances])
            return at.at(tolerances, [(places["effectors"], early)], form_error)
        return settled(self, form_error, acting)

    monkeypatch.setattr(Linearised, "settled", search)
    found, without = at.settled_beside_none(at.evidence.form_error())
    evidence = replace(found.evidence, without=without)
    assert np.argmax(evidence.candidate) == places["rates"]
    assert evidence.statistic > 30


@pytest.mark.parametrize("reads", [0.72, pytest.param(1.1, marks=pytest.mark.slow)])
def test_gyros_of_another_scale_are_given_with_it(reads):
    """An effect is taken back as its tolerance is: tolerances alone would seem likelier than the truth."""
    library = {n: e for n, e in LIBRARY.items() if n != "gyro"} | {"sensor_scale": shipped()["sensor_scale"]}
    flights = []
    for seed in (1, 2):
        flight = fly(noise=1.0, seed=seed, phases=seed, duration=40.0)
        read = flight.record.channel("state/q")
        scaled = flight.record.with_channels(replace(read, values=reads * read.values))
        flights.append(replace(flight, record=scaled))
    question = Question(library, {"sensor_scale.q": 0.01}, (0.1, 2.0), draws=100, close=False)
    which = diagnose(Uncertain(), flights, question).diagnosis.which
    assert which.named == ("sensor_scale",)
    size = which.parameters["sensor_scale"]["q"]
    assert size.lo < reads - 1 < size.hi
    assert size.hi - size.lo < 0.06


def test_where_a_fit_asks_for_a_body_that_cannot_be_all_else_is_still_asked_for_together(slopes):
    """With 30 % less of its inertia in pitch, the aircraft would have more in yaw than in pitch and roll."""
    lighter = slopes / np.array([[1.0], [1.0], [0.7]])
    found = diagnosed(lighter, LIBRARY | {"inertia": shipped()["inertia"]}, TOLERANCES | {"inertia.yy": 0.15})
    assert not found.diagnosis.gap.exists
    fitted = found.system.likeliest_tolerances(found.evidence.form_error(), np.zeros(found.system.columns))
    assert dict(zip(found.system.tolerances, fitted, strict=True))["inertia.yy"] == pytest.approx(-2, abs=0.3)


def test_an_effect_with_which_a_simulation_is_not_finite_is_not_taken(found, monkeypatch):
    """Loads of 1e187 N make a misfit that is not a number, and no comparison with that is true."""
    form = found.evidence.form_error()
    at = Linearised(found.system, found.columns, found.blocks, LIBRARY, TOLERANCES)
    at = at.at(np.array([2.0]), [], form)
    asked = Linearised.at

    def overflown(self, fitted, acting, form_error, **options):
        there = asked(self, fitted, acting, form_error, **options)
        about = there.system.about._replace(misfit=np.nan if acting else there.system.about.misfit)
        return replace(there, system=replace(there.system, about=about))

    monkeypatch.setattr(Linearised, "at", overflown)
    taken = at.likelier(form, [(0, joint_estimates(at.system, [0])[0])])
    assert not taken.system.about.acting
    assert np.isfinite(taken.system.about.misfit)

"""The words that a verdict gives a diagnosis in, and what stands beside it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from linear_flight import fly

from freqid.core.results.diagnosis import Closure, Existence, Interval, SensorFault, Share, Which
from freqid.core.results.gap import GapMap
from freqid.gap.simulation import Tolerance
from freqid.gap.verdict import remarks_of, tolerances_used, verdict
from freqid.simulate.effects import library

GAP = Existence(True, 1e-6, 0.02, 0.0, {}, {}, noise_from=("repeats of the manoeuvre",))
NOWHERE = GapMap((), (), (), (), np.zeros((0, 0, 0, 0)), np.zeros((0, 3)))
LOSS = Interval(0.5, 0.4, 0.6, "1")
WORN = Which(
    {"surface_effectiveness": 0.97, "none": 0.03},
    ("surface_effectiveness",),
    (),
    {},
    {"surface_effectiveness": {"de": LOSS}},
    named=("surface_effectiveness",),
    places={"surface_effectiveness": "de"},
)
CLOSURE = Closure(
    ("surface_effectiveness",),
    {},
    Share(0.98, 0.9, 1.0),
    Share(np.nan, np.nan, np.nan),
    {},
    {},
    {},
    ("far/away/c.h5",),
    tolerances_only=Share(0.9, 0.8, 1.0),
    strained={"derivatives.M.de": -9.4},
)


def said(which=WORN, closures=(), sensors=(), gap=GAP, cells=NOWHERE):
    return verdict(gap, (), cells, which, closures, sensors, library())


def test_a_name_stands_with_place_size_meaning_and_probability():
    text = said()
    assert text.startswith("A gap beyond noise and tolerances. Your simulation: ")
    assert "surface_effectiveness of de 0.5 (0.4 to 0.6) (The air feels less" in text
    assert text.endswith("probability 0.97.")


@pytest.mark.parametrize(
    ("row", "share"), [("M", ", 21 % of the changes in M"), ("Z", ", 1 % of the changes in Z"), ("X", "")]
)
def test_how_much_of_the_row_with_the_gap_an_effect_is_stands_with_it(row, share):
    shares, phase = np.array([[[[1.0, 0.0]]]]), np.full((1, 3), 1 / 3)
    cells = GapMap((row,), ("u20",), ("de", ""), ((0.1, 2.0),), shares, phase)
    text = said(replace(WORN, moves={"surface_effectiveness": {"M": 0.213, "Z": 0.01}}), cells=cells)
    assert text.endswith(f"){share}, probability 0.97.")


def test_a_place_keeps_its_name_where_something_else_is_given_of_it():
    sizes = {"n4": Interval(0.06, 0.05, 0.07, "s"), "time_constant": Interval(0.055, 0.055, 0.055, "s")}
    late = replace(
        WORN,
        probabilities={"motor_lag": 1.0},
        parameters={"motor_lag": sizes},
        named=("motor_lag",),
        places={"motor_lag": "n4 time_constant=0.055"},
    )
    assert "motor_lag of n4 0.06 s (0.05 to 0.07) (Motors follow" in said(late)


def test_what_goes_stands_beside_what_tolerances_would_have_to_do():
    text = said(closures=(CLOSURE,))
    assert (
        "with it 98 % of the gap is closed on c.h5. Without it, tolerances alone would close 90 % of it, "
        "but only with derivatives.M.de off by 9 times its stated tolerance." in text
    )
    held = said(closures=(replace(CLOSURE, scored="held out"),))
    assert "closed on c.h5, which was held out. Without it" in held
    near = replace(CLOSURE, strained={"derivatives.M.de": 1.2})
    assert said(closures=(near,)).endswith("would close 90 % of it.")
    told = said(closures=(replace(near, log_score=17.2),))
    assert told.endswith(
        "90 % of it, each off by less than 3 times what is stated; so many at once are less likely than it, "
        "by 17 nats."
    )


def test_an_effect_that_closes_less_alone_is_said_to():
    alone = replace(CLOSURE, effect_only=Share(0.04, 0.0, 0.1))
    text = said(closures=(alone,))
    assert "is closed on c.h5, 4 % while all that has a tolerance stays nominal. Without it" in text


def test_a_closure_by_two_effects_is_said_of_both():
    two = replace(CLOSURE, effects=("surface_effectiveness", "mass"), effect_only=Share(0.04, 0.0, 0.1))
    text = said(replace(WORN, pair=("surface_effectiveness", "mass")), closures=(two,))
    assert "both 98 % of the gap is closed on c.h5, 4 % while all that has a tolerance stays nominal" in text
    assert "Without them, tolerances alone" in text


def test_a_name_that_is_withdrawn_is_none():
    gone = replace(WORN, named=(), withdrawn={"surface_effectiveness": "its size is at the end"})
    text = said(gone, (CLOSURE,))
    assert "no name; surface_effectiveness fits best but its size is at the end" in text
    assert "goes on" not in text


def test_sensors_and_simulation_have_a_sentence_each():
    bias = {"sensor_bias": {"q": Interval(0.01, 0.008, 0.012, "rad/s")}}
    fault = SensorFault("sensor_bias", "q", 0.01, 0.008, 0.012, "rad/s")
    both = replace(
        WORN,
        pair=("sensor_bias", "surface_effectiveness"),
        named=(),
        parameters={**WORN.parameters, **bias},
        places={"sensor_bias": "q", **WORN.places},
    )
    text = said(both, sensors=(fault,))
    assert "Your sensors: sensor_bias of q 0.01 rad/s (0.008 to 0.012). Your simulation: surface_eff" in text
    alone = replace(both, pair=(), named=("sensor_bias",))
    assert "Your simulation: nothing beside that" in said(alone, sensors=(fault,))


def test_where_nothing_is_likely_enough_what_remains_is_listed():
    open_ = replace(
        WORN, probabilities={"mass": 0.5, "stall": 0.4, "none": 0.1}, set=("mass", "stall"), named=()
    )
    assert "no single name; mass, stall remain possible" in said(open_)
    alike = replace(WORN, named=("mass", "sensor_scale"))
    assert "one of mass, sensor_scale, which these data cannot separate" in said(alike)
    sized = replace(alike, parameters={"mass": {"fraction": Interval(0.075, 0.05, 0.1, "1")}})
    assert "one of mass 0.075 (0.05 to 0.1), sensor_scale, which" in said(sized)
    other = replace(WORN, probabilities={"other": 0.9, "none": 0.1}, named=())
    assert "no effect of the library explains it (90 % for another)" in said(other)


def test_without_a_gap_the_sizes_that_would_have_been_seen_are_said():
    none = Existence(False, 0.4, 0.02, 0.5, largest_undetected={"mass": 0.1}, unit={"mass": "1"})
    larger = "no gap larger than mass 0.1 (found in 95 of 100 cases)"
    assert said(gap=none) == f"No gap beyond noise and tolerances (p = 0.4): {larger}."
    poor = replace(none, form_errors={"X": 0.8, "M": 0.01})
    assert poor.unconfirmed
    assert said(gap=poor).startswith("No effect is called (p = 0.4), and the simulation is not confirmed: ")
    assert "wrong by 80 % in X, in ways that no tested effect explains" in said(gap=poor)
    assert not replace(none, form_errors={"X": 0.04}).unconfirmed


def test_a_close_call_says_what_it_would_be():
    near = Existence(False, 0.04, 0.02, 0.5, largest_undetected={"mass": 0.1}, unit={"mass": "1"})
    which = replace(WORN, probabilities={"none": 0.5, "mass": 0.4, "other": 0.1}, named=(), parameters={})
    text = said(which, gap=near)
    assert "(found in 95 of 100 cases). It is a close call: a gap is called up to p = 0.02. " in text
    assert "its likeliest cause is mass (probability 0.80)" in text
    unknown = replace(which, probabilities={"none": 0.5, "other": 0.5})
    assert "a change that no effect of the library describes (probability 1.00)" in said(unknown, gap=near)
    assert "close call" not in said(which, gap=replace(near, p=0.1))


def test_a_narrow_interval_is_said_with_as_many_digits_as_it_has():
    size = {"surface_effectiveness": {"de": Interval(0.15171, 0.14733, 0.15488, "1")}}
    assert "surface_effectiveness of de 0.1517 (0.1473 to 0.1549)" in said(replace(WORN, parameters=size))


def test_error_of_form_and_noise_are_said_in_words():
    simulation = SimpleNamespace(name="sim", tolerances={})
    remarks = list(remarks_of([], simulation, replace(GAP, form_errors={"Z": 0.02}), {"w": 0.3}, tried=True))
    assert any("error of form of about 2 % in Z" in r for r in remarks)
    assert any("30 % of dw/dt" in r for r in remarks)
    assert "noise learned from repeats of the manoeuvre" in remarks
    assert any("no error of form" in r for r in remarks_of([], simulation, GAP, {}, tried=True))


def test_tolerances_stand_with_unit_and_source():
    simulation = SimpleNamespace(tolerances={"lift_slope": Tolerance(0.3, "1/rad")})
    sizes = {"mass": 0.01, "cg_offset": 0.02, "lift_slope": 0.3, "sensor_bias.q": 0.002, "inertia": 0.0}
    found = {t.name: (t.sigma, t.unit, t.source) for t in tolerances_used(sizes, simulation, library())}
    assert found == {
        "mass": (0.01, "1", "default"),
        "cg_offset": (0.02, "m", "stated"),
        "lift_slope": (0.3, "1/rad", "simulation"),
        "sensor_bias.q": (0.002, "rad/s", "each record"),
    }
    given = ("mass", "lift_slope", "sensor_bias.q")
    told = {t.name: t.source for t in tolerances_used(sizes, simulation, library(), given=given)}
    assert told == {
        "mass": "stated",
        "cg_offset": "stated",
        "lift_slope": "stated",
        "sensor_bias.q": "each record",
    }
    stated = {**sizes, "time_skew": 0.001, "sensor_bias.V": 0.1, "sensor_bias.surface": 0.005}
    flight = fly()  # with gyros and surfaces, and no airspeed
    timed = {t.name: t for t in tolerances_used(stated, simulation, library(), flight)}
    assert {"sensor_bias.q", "sensor_bias.surface"} <= set(timed)
    assert "sensor_bias.V" not in timed
    assert timed["time_skew"].source == "stated"
    late = timed["actuator_delay"]
    clock = pytest.approx(flight.record.dt / np.sqrt(12))
    assert (late.sigma, late.unit, late.source) == (clock, "s", "clock")


def test_a_withdrawn_name_says_what_tolerances_would_have_to_be():
    """Where a parameter that is far off explains a gap better than an effect, it is said which."""
    which = replace(WORN, named=(), withdrawn={"surface_effectiveness": "it predicts worse"})
    text = said(which, (CLOSURE,))
    assert "no name; surface_effectiveness fits best but it predicts worse" in text
    assert text.endswith(
        "; without any effect it takes derivatives.M.de off by 9 times its stated tolerance to close it."
    )
    assert "it takes" not in said(which, (replace(CLOSURE, strained={"mass.fraction": 1.2}),))


def test_the_words_of_an_effect_have_the_sign_that_its_interval_leaves():
    def words(lo, hi):
        size = Interval((lo + hi) / 2, lo, hi, "1")
        return said(
            replace(
                WORN,
                probabilities={"mass": 0.99},
                parameters={"mass": {"fraction": size}},
                named=("mass",),
                places={},
            )
        )

    assert "(The vehicle is lighter than it is described)" in words(-0.18, -0.14)
    assert "(The vehicle is heavier than it is described)" in words(0.14, 0.18)
    assert "(The vehicle is heavier or lighter than it is described)" in words(-0.1, 0.2)


def test_the_verdict_names_signals_only_where_their_lines_hold_the_gap():
    def words(at_rest, driven, inputs=("de", "")):
        energy = np.zeros((1, 1, 1, len(inputs)))
        energy[..., 0], energy[..., -1] = driven, at_rest
        cells = GapMap(("Z",), ("u30",), inputs, ((0.0, 0.12),), energy, np.full((1, 3), 1 / 3))
        return verdict(GAP, cells.places(), cells, WORN, (), (), library())

    assert "in Z, mostly 0-0.12 Hz, on lines that no signal drives, the mean among them. " in words(9e5, 2.0)
    assert "on lines that no signal drives, the mean among them. " in words(5.0, 1.0)
    assert "in Z, mostly 0-0.12 Hz, on the lines of de. " in words(5.0, 5.0)
    assert "in Z, mostly 0-0.12 Hz. " in words(5.0, 5.0, ("",))

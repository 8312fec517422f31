"""A sealed trial: the draw is the seed's, the seal holds, and the answer is what the diagnosis said."""

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_gap import made_up

import freqid as fq
from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord
from freqid.core.results.diagnosis import Interval
from freqid.core.results.judged.sealed_trial import SEAL_FILE, SealedEffect
from freqid.core.store import editing
from freqid.simulate.effects import loaded, settings
from freqid.simulate.motion.whole_vehicle import LONGEST_DELAY
from freqid.workflows.reviews import sealed_trial
from freqid.workflows.reviews.sealed_trial import draw_effect, open_seal

LA8 = fq.read_scenario("la8")


def test_the_seed_draws_effect_place_and_size_within_what_is_possible():
    drawn = [draw_effect(LA8, seed) for seed in range(60)]
    assert drawn == [draw_effect(LA8, seed) for seed in range(60)]
    assert len(Counter(effect for effect, *_ in drawn)) >= 8
    for effect, parameter, _, before, after in drawn:
        assert after != before
        full = settings({effect: {parameter: after}}, LA8.aircraft())  # refuses what is out of range
        loaded(LA8.aircraft(), full)  # refuses what no body can be
        assert not effect.startswith("actuator_delay") or after < LONGEST_DELAY


def sealed(folder, effect="stall", size=0.45, records=("a.h5", "b.h5", "c.h5")):
    path = folder / "seal.h5"
    one = SealedEffect("0" * 64, 3, effect, "strength", "1", 0.0, size, dict.fromkeys(records, "f" * 64))
    SEAL_FILE.write(path, one.seal())
    return path


def said(**changes):
    """Return the made-up diagnosis with another answer to which."""
    found = made_up()
    which = replace(found.which, **{"withdrawn": {}, **changes})
    return replace(found, diagnosis=replace(found.diagnosis, which=which))


def test_a_name_is_right_or_wrong(tmp_path):
    seal = sealed(tmp_path)
    found = open_seal(seal, said(named=("stall",)))
    assert (found.answer, found.probability, found.named) == ("right", 0.7, ("stall",))
    assert found.covered  # 0.45 within 0.3 to 0.5
    assert "inside the 90 % interval" in found.sentence
    assert open_seal(seal, said(named=("stall", "mass"))).answer == "right"  # a group that is not told apart
    assert open_seal(seal, said(named=("mass",))).answer == "wrong"
    assert open_seal(seal, said(pair=("stall", "mass"))).answer == "wrong"  # the second is not there
    far = {"stall": {"strength": Interval(0.9, 0.8, 1.0, "1")}}
    assert not open_seal(seal, said(named=("stall",), parameters=far)).covered


def test_no_name_is_undecided_and_no_gap_is_wrong_only_where_it_should_have_been_seen(tmp_path):
    seal = sealed(tmp_path)
    assert open_seal(seal, said()).answer == "undecided"
    withdrawn = open_seal(seal, said(named=("stall",), withdrawn={"stall": "for a reason"}))
    assert withdrawn.answer == "undecided"
    assert "stall fits best and is withdrawn, for a reason" in withdrawn.sentence
    none = made_up(exists=False)
    for least, answer in ((0.2, "wrong"), (0.9, "undecided")):
        gap = replace(none.gap, largest_undetected={"stall": least})
        assert open_seal(seal, replace(none, diagnosis=replace(none.diagnosis, gap=gap))).answer == answer


def test_a_seal_that_was_edited_or_is_of_other_flights_is_refused(tmp_path):
    seal = sealed(tmp_path)
    with pytest.raises(DataError, match="the diagnosis is of"):
        open_seal(sealed(tmp_path, records=("a.h5",)), said())
    seal = sealed(tmp_path)
    (tmp_path / "a.h5").write_bytes(b"another flight")
    with pytest.raises(DataError, match=r"a\.h5 is not the flight that was sealed"):
        open_seal(seal, said())
    with editing(seal) as file:
        file.attrs["effect"] = "mass"
    with pytest.raises(DataError, match="was edited after it was sealed"):
        open_seal(seal, said())


def test_an_outcome_goes_through_its_file_and_has_a_page(tmp_path):
    found = open_seal(sealed(tmp_path), said(named=("stall",)))
    fq.save(found, tmp_path / "trial.h5")
    assert fq.read(tmp_path / "trial.h5") == found
    text = fq.page(tmp_path / "trial.h5").html
    assert "The diagnosis is right" in text
    assert "A gap beyond noise." in text  # what it said before


def test_flights_are_flown_with_what_the_seal_alone_names(tmp_path, monkeypatch):
    flown = []

    def simulate(scenario, design, *, at, effects, **how):
        flown.append((at, effects, how["noise"]))
        time = np.arange(50) / 50
        channels = {"state/u": Channel("state/u", "m/s", 14 + 0 * time, 50.0, at)}
        record = FlightRecord(time, channels, scenario.aircraft(), reference=at)
        return SimpleNamespace(divergence="", record=record)

    monkeypatch.setattr(sealed_trial, "simulate", simulate)
    done = sealed_trial.fly_sealed(LA8, tmp_path, at=("u30", "u45"), design=object(), seed=4)
    effect, parameter, _, before, after = draw_effect(LA8, 4)
    assert flown == [(at, {effect: {parameter: after}}, 1.0) for at in ("u30", "u45")]
    found = SEAL_FILE.read(done.seal)
    assert (found.effect, found.parameter, found.before, found.after) == (effect, parameter, before, after)
    assert found.checksum == done.checksum
    assert set(found.records) == {"u30.h5", "u45.h5"} == {p.name for p in done.records}
    assert not any(effect.encode() in p.read_bytes() for p in done.records)
    assert not list(tmp_path.glob("*truth*"))
    monkeypatch.setattr(
        sealed_trial, "simulate", lambda *_, **__: SimpleNamespace(divergence="by its mass", record=None)
    )
    with pytest.raises(DataError, match="the sealed flight at u30 diverges") as said_so:
        sealed_trial.fly_sealed(LA8, tmp_path, at=("u30",), design=object(), seed=4)
    assert "mass" not in str(said_so.value)  # a sentence of the divergence could tell the effect

"""A campaign in one flight: trims are reached and held, manoeuvres are flown there and cut out again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.scenario import read_scenario
from freqid.core.sections.trim_sequence import Campaign, CampaignTrim
from freqid.flightlog.cut import find_maneuvers
from freqid.simulate.local_coefficients import local_coefficients
from freqid.workflows.fly_trim_sequence import simulate_campaign, trims_flown
from freqid.workflows.models.identify import identify_point

DEP6 = read_scenario(Path(__file__).resolve().parents[3] / "scenarios" / "dep6.toml")[0]
TRIMS = (
    CampaignTrim(speed=17.0, climb_rad=0.15),
    CampaignTrim(speed=16.0, climb_rad=-0.09, rotors="stopped"),
    CampaignTrim(speed=19.0, climb_rad=-0.03),
)


def with_campaign(trims=TRIMS, **changes):
    campaign = msgspec.structs.replace(DEP6.campaign, trim=trims, **changes)
    return msgspec.structs.replace(DEP6, campaign=campaign)


@pytest.fixture(scope="module")
def flight():
    return simulate_campaign(with_campaign(), noise=1.0, turbulence=1.0, seed=2)


def test_each_trim_is_held_while_its_manoeuvre_is_flown(flight):
    flown = trims_flown(flight)
    assert len(flown) == 3
    for at, wanted in zip(flown, TRIMS, strict=True):
        assert at.speed == pytest.approx(wanted.speed, abs=0.5)
        assert at.climb == pytest.approx(wanted.climb_rad, abs=0.03)
    assert np.isinf(flown[1].advance_ratio)
    # J = V / n D by hand, n the mean of six rotors
    part = flight.truth.cut(*flown[0].span_s)
    turns = np.mean([part[f"effector/n{i}"].mean() for i in range(1, 7)]) / (2 * np.pi)
    assert flown[0].advance_ratio == pytest.approx(part["air/V"].mean() / (turns * 0.23), rel=1e-6)


def test_rotors_turn_together_stop_in_the_glide_and_hold_their_advance_ratio(flight):
    truth = flight.truth
    speeds = truth.matrix(f"effector/n{i}" for i in range(1, 7))
    assert np.ptp(speeds, axis=0).max() < 1e-6
    (_, _), (start, stop), (_, _) = find_maneuvers(flight.record, margin_s=0.0)
    inside = (truth.time > start + 1) & (truth.time < stop)
    assert speeds[:, inside].max() < 0.01
    first = truth.cut(15.0, 33.0)  # the excitation of the first trim, after its first second
    ratio = first["air/V"] / first["command/n1"]
    still = np.std(ratio) / np.mean(ratio)
    assert still < 0.02 < np.ptp(first["air/V"]) / first["air/V"].mean()


def test_manoeuvres_are_found_with_and_without_the_injected_signals_in_the_log(flight):
    record = flight.record
    begins = [14.0 + 40.0 * i for i in range(3)]
    found = find_maneuvers(record)
    assert len(found) == 3
    for (start, stop), begin in zip(found, begins, strict=True):
        assert begin - 2.0 < start < begin
        assert begin + 20.0 < stop < begin + 26.0
    channels = {n: c for n, c in record.channels.items() if not n.startswith("excitation/")}
    blind = find_maneuvers(replace(record, channels=channels))
    for begin in begins:
        assert any(start < begin + 0.5 and stop > begin + 19.0 for start, stop in blind)


def test_point_models_find_the_local_derivatives(flight):
    """Standard errors tell how far off each may be; the truth is differentiated in the simulation."""
    off = []
    for span in find_maneuvers(flight.record):
        piece, truth = flight.record.cut(*span), flight.truth.cut(*span)
        expected = local_coefficients(flight.scenario, truth)
        model = identify_point(piece, flight.scenario)
        for name in ("Z", "M", "Y", "L", "N"):
            found = model.responses[name]
            for regressor, value, error in zip(
                found.regressors, found.estimate, found.std_error, strict=True
            ):
                off.append((value - expected[name][regressor]) / error)
    assert np.sqrt(np.mean(np.square(off))) < 1.8
    assert np.abs(off).max() < 6.0


def test_density_follows_the_planned_climbs(flight):
    truth = flight.truth
    planned = np.sum([40.0 * t.speed * np.sin(t.climb_rad) for t in TRIMS])
    # the density of the standard atmosphere falls by about 9.6e-5 of itself a metre near the ground
    fall = np.log(truth["air/rho"][-1] / truth["air/rho"][0])
    assert fall == pytest.approx(-9.6e-5 * planned, rel=0.05)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: msgspec.structs.replace(s, campaign=None), r"no \[campaign\]"),
        (lambda s: msgspec.structs.replace(s, control={}), r"no \[control.tecs\]"),
        (lambda s: with_tecs(s, pitch={"dee": 1.0}), "names surface 'dee'.*'de'"),
        (lambda s: with_tecs(s, gain=1.0), "'gain' is unknown"),
        (
            lambda s: msgspec.structs.replace(s, campaign=Campaign(trim=TRIMS, start="u99")),
            "no reference 'u99'",
        ),
    ],
)
def test_what_is_missing_is_said_in_one_sentence(change, words):
    with pytest.raises(UsageError, match=words):
        simulate_campaign(change(DEP6))


def with_tecs(scenario, **changes):
    table = {**scenario.control, "tecs": {**scenario.control["tecs"], **changes}}
    return msgspec.structs.replace(scenario, control=table)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: CampaignTrim(speed=0.0), "speed is 0"),
        (lambda: CampaignTrim(speed=20.0, climb_rad=30.0), "climb_rad is 30"),
        (lambda: Campaign(trim=()), "no trim"),
        (lambda: Campaign(trim=TRIMS, rest_s=0.0), "rest_s is 0"),
    ],
)
def test_values_that_cannot_be_flown_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()

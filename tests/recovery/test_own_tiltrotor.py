"""A tilt-rotor that is flown by other formulas: nacelles, their rotors and the centre of gravity turn."""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

import freqid as fq

ROOT = Path(__file__).parents[2]
AT = "u22"


@pytest.fixture(scope="module")
def own():
    sys.path.insert(0, str(ROOT / "examples"))
    import own_tiltrotor

    return own_tiltrotor


@pytest.fixture(scope="module")
def scenario():
    whole = fq.read_scenario(ROOT / "scenarios" / "tiltrotor.toml")
    short = msgspec.structs.replace(
        whole.excitation, period_s=30.0, starts=2, power_db=0.0, allocation="interleaved"
    )
    return msgspec.structs.replace(whole, excitation=short)


@pytest.fixture(scope="module")
def flight(own, scenario, tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    design = fq.design_inputs(scenario, at=AT, seed=0)
    assert design.trim["nac_fl"] == scenario.reference_of(AT)["nac_fl"]
    time, excitation = own.design_of(design.write_csv(folder / "design.csv"))
    table = own.log(AT, time, excitation, own.fly(AT, time, excitation), seed=3, noise=0.01)
    table.to_csv(folder / "log.csv", index=False, float_format="%.12g")
    return fq.read_log(folder / "log.csv", ROOT / "scenarios" / "maps" / "tiltrotor.toml", scenario=scenario)


def normalised(model, own):
    """Errors over standard errors, by response and regressor."""
    names = (*own.STATES, *own.FREE)
    truth = own.true_derivatives(AT)
    return {
        (response, regressor): (model[response][regressor][0] - truth[i, names.index(regressor)])
        / model[response][regressor][1]
        for i, response in enumerate("XYZLMN")
        for regressor in model[response].regressors
    }


@pytest.mark.slow
def test_its_derivatives_are_found_within_their_intervals(own, scenario, flight):
    """With a hundredth of the noise, so that intervals show what the two sets of formulas do not share."""
    model = fq.identify_point(flight, scenario, at=AT)
    assert not model.remarks  # tilts and flap are where the reference says
    errors = np.array([*normalised(model, own).values()])
    assert errors.size == 120
    assert np.mean(np.abs(errors) < 2) > 0.85  # 95 %, and five standard deviations of a share of 120
    assert np.abs(errors).max() < 5
    assert np.sqrt(np.mean(errors**2)) < 1.3


def without(scenario, left_out):
    """The same aircraft, with something left out of its description."""
    change = msgspec.structs.replace
    if left_out == "masses of the nacelles":
        return change(scenario, wing=tuple(change(w, mass_kg=0.0) for w in scenario.wing))
    if left_out == "inertia of the rotors":
        return change(scenario, rotor=tuple(change(r, inertia=0.0) for r in scenario.rotor))
    return change(scenario, rotor=tuple(change(r, wing=None) for r in scenario.rotor))


@pytest.mark.parametrize(
    "left_out", ["masses of the nacelles", "inertia of the rotors", "rotors that turn with the nacelles"]
)
def test_without_what_turns_they_are_missed(own, scenario, flight, left_out):
    """What is described of the nacelles is what the agreement is due to."""
    poorer = without(scenario, left_out)
    model = fq.identify_point(fq.Maneuver(flight, poorer.aircraft()), poorer, at=AT)
    errors = normalised(model, own)
    moments = np.array([x for (response, _), x in errors.items() if response in "LN"])
    assert np.sqrt(np.mean(moments**2)) > 20


def test_the_description_balances_where_its_own_formula_says(own, scenario):
    points = {p.reference: p.position_m for p in fq.check_scenario(scenario).moment_points}
    for condition in own.CONDITIONS:
        at = scenario.reference_of(condition)
        expected = own.centre_of_gravity(np.array([at[n] for n in own.NACELLES]))
        np.testing.assert_allclose(points[condition], expected, atol=1e-6)
        trimmed, unbalanced = own.trim(condition)
        assert unbalanced < 1e-6
        np.testing.assert_allclose([at[n] for n in own.NACELLES], trimmed[10:14], atol=1e-4)

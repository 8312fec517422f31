"""``[excitation.at.ID]``: what is flown differently at one reference condition."""

from __future__ import annotations

import pytest
from test_scheduled_variables import FLAP, NACELLES, reference, scenario

from freqid.core.errors import UsageError
from freqid.workflows.design import design_inputs

BASE = """
[excitation]
band_hz = [0.1, 1.0]
period_s = 20.0
starts = 2
effectors = ["nac_fl", "nac_fr", "flap"]
amplitude = { nac_fl = 0.05, nac_fr = 0.05, flap = 0.02 }
"""
THERE = "[excitation.at.u60]\nperiod_s = 30.0\namplitude = { nac_fl = 0.02, nac_fr = 0.02 }\n"
AT = reference(id="u20", u=20, rho=1.2, nac_fl=0.8, nac_fr=0.8, flap=0.35) + reference(
    id="u60", u=60, rho=1.2, nac_fl=0.04, nac_fr=0.04, flap=0.35
)


def test_a_reference_changes_what_it_names_and_keeps_the_rest(tmp_path):
    found = scenario(tmp_path, NACELLES, FLAP, AT, BASE, THERE)
    there = found.at("u60").excitation
    assert there.period_s == 30.0
    assert there.amplitude == {"nac_fl": 0.02, "nac_fr": 0.02, "flap": 0.02}
    assert there.band_hz == (0.1, 1.0)
    assert found.at("u20").excitation == found.excitation
    designs = {at: design_inputs(found, at=at).design for at in ("u20", "u60")}
    assert {at: d.period_s for at, d in designs.items()} == {"u20": 20.0, "u60": 30.0}


def test_limits_count_from_where_the_tilt_is(tmp_path):
    """At u60 the nacelle is 0.04 rad above its lower limit: 0.05 rad fit about the middle, not there."""
    found = scenario(tmp_path, NACELLES, FLAP, AT, BASE)
    assert design_inputs(found, at="u20").trim == {"nac_fl": 0.8, "nac_fr": 0.8, "flap": 0.35}
    design_inputs(found)
    with pytest.raises(
        UsageError, match=r"'nac_f.', 0.05 rad, makes peaks .* limits allow 0.04 about 0.04, where it is"
    ):
        design_inputs(found, at="u60")


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ("[excitation.at.u61]\nperiod_s = 30.0\n", r"names reference 'u61'.* did you mean 'u60'"),
        ("[excitation.at.u60]\nperiod = 30.0\n", r"excitation.at.u60: .*period"),
        ("[excitation.at.u60]\nperiod_s = -1.0\n", r"excitation.at.u60: .*expected a positive time"),
    ],
)
def test_what_does_not_fit_is_refused_when_the_file_is_read(tmp_path, table, says):
    with pytest.raises(UsageError, match=says):
        scenario(tmp_path, NACELLES, FLAP, AT, BASE, table)

"""`freqid.study` of a campaign, with a flight by scipy in place of the simulation."""

import msgspec
import numpy as np
import pytest
from scipy_flight import SCENARIO, derivatives, one_flight

import freqid as fq
from freqid.core.errors import DataError, GateFailed, UsageError
from freqid.core.record import write_record
from freqid.core.scenario import Gates
from freqid.core.sections.trim_sequence import Campaign, CampaignTrim
from freqid.workflows.studies import study_by_advance_ratio
from freqid.workflows.studies.studied import refuse_missed_study_gates

RATIOS = (0.36, 0.45, 0.55, 0.65, 0.75, 0.9, np.inf, np.inf)


class Flown:
    def __init__(self, record):
        self.record = record

    def save(self, path):
        write_record(path, self.record)


@pytest.fixture
def flights(monkeypatch):
    """Flights that were asked for, with no output error: its model takes long to compile."""
    asked = []

    def simulate(scenario, **conditions):
        asked.append(conditions)
        return Flown(one_flight(RATIOS))

    def refuse(*args, **kwargs):
        raise DataError("no such model")

    monkeypatch.setattr(study_by_advance_ratio, "simulate_campaign", simulate)
    monkeypatch.setattr(study_by_advance_ratio, "identify_output_error", refuse)
    return asked


def test_a_campaign_goes_from_the_flight_to_the_page(flights, tmp_path):
    said = []
    study = fq.study(SCENARIO, tmp_path / "study", turbulence=0.5, seed=3, tell=said.append)
    assert flights == [{"sensors": "research", "noise": 1.0, "turbulence": 0.5, "seed": 3}]
    assert len(study.local.ids) == len(RATIOS)
    np.testing.assert_allclose(np.sort(study.local.advance_ratio), RATIOS, rtol=0.02)
    law = study.model("global").clusters[0]["Cm.de"]
    assert law.form == "one exponential"
    low, high = law.interval(np.inf)
    assert low < derivatives(np.inf)["Cm"][3] < high
    assert study.scores.models == ("local", "global", "semi-local", "one-shot")
    assert 0.3 < study.local.advance_ratio[study.local.ids.index(study.shown)] < 0.9
    assert study.coefficients["one-shot"]["M"].r2 > 0.9
    assert any("not compared in time: no such model" in remark for remark in study.remarks)
    assert "Coefficients in time" in fq.page(study).html
    for name in (
        "flight.h5",
        "maneuvers/m03.h5",
        "points/m07.h5",
        "global.h5",
        "semi-local.h5",
        "one-shot.h5",
    ):
        assert (tmp_path / "study" / name).is_file()

    assert set(study.points) == set(study.local.ids)
    assert set(study.validation) == set(study.scores.ids)
    weak = {r: max(of[r] for of in study.validation.values()) for r in next(iter(study.validation.values()))}

    def judge(**gates):
        refuse_missed_study_gates(study, msgspec.structs.replace(SCENARIO, gates=Gates(**gates)), "out")

    judge(r2=-10.0, collinearity=1e6, validation={r: value + 1e-9 for r, value in weak.items()})
    with pytest.raises(GateFailed, match=r"validation error of M is .*, held out") as missed:
        judge(validation={"M": 0.5 * weak["M"]})
    assert all(f"in {i}" not in str(missed.value) for i in study.local.ids if i not in study.scores.ids)
    with pytest.raises(GateFailed, match=r"variance inflation of \w is .* moved together .* in m00"):
        judge(collinearity=1.0001)
    with pytest.raises(GateFailed, match=r"and \d+ more"):
        judge(r2=2.0)
    twice = tuple(CampaignTrim(speed=v) for v in (15.0, 16.0, 15.0))
    flown = msgspec.structs.replace(SCENARIO, campaign=Campaign(trim=twice))
    repeated = study_by_advance_ratio._repeated(flown, study.points, 3)
    assert set(repeated) == {"m00 and m02"}
    assert min(repeated["m00 and m02"].values()) < 1e-3  # at two advance ratios, in truth
    assert study_by_advance_ratio._repeated(flown, study.points, 2) == {}

    again = fq.study(SCENARIO, tmp_path / "study", turbulence=0.5, seed=3, held_out=["m01", "m04"])
    assert len(flights) == 1  # what is done is kept
    assert again.scores.ids == ("m01", "m04")


def test_a_manoeuvre_that_cannot_be_identified_is_left_out(flights, tmp_path, monkeypatch):
    identify, calls = study_by_advance_ratio.identify_point, []

    def sometimes(*args, **kwargs):
        calls.append(args)
        if len(calls) == 3:
            raise DataError("the injected signals hardly move 'alpha'")
        return identify(*args, **kwargs)

    monkeypatch.setattr(study_by_advance_ratio, "identify_point", sometimes)
    study = fq.study(SCENARIO, tmp_path, held_out=["m01", "m04"])
    assert "m02" not in study.local.ids
    assert len(study.local.ids) == len(RATIOS) - 1
    assert "Manoeuvre m02 is left out: the injected signals hardly move 'alpha'." in study.remarks


def test_what_a_campaign_cannot_do_is_said(flights, tmp_path):
    with pytest.raises(UsageError, match="a campaign flies all its trims"):
        fq.study(SCENARIO, tmp_path, at=["u20"])
    with pytest.raises(UsageError, match="manoeuvre 'm77' cannot be held out, the campaign has m00 to m07"):
        fq.study(SCENARIO, tmp_path, held_out=["m77"])
    with pytest.raises(UsageError, match="turbulence is of a campaign"):
        fq.study("la8", tmp_path, turbulence=1.0)

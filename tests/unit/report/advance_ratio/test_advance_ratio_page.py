"""Pages and figures of laws against advance ratio."""

import re
from dataclasses import replace

import numpy as np
import pytest
from blown_campaign import campaign, problems_of
from page_script import without_script

import freqid as fq
from freqid.blend.semi_local.advance_ratio_study import CampaignStudy, inner_trims
from freqid.blend.semi_local.held import semi_local_model
from freqid.blend.semi_local.held_out import score_held_out
from freqid.blend.semi_local.one_shot import one_shot_model
from freqid.blend.semi_local.parametric import global_model
from freqid.core.results.fit import Fit


@pytest.fixture(scope="module")
def study():
    local = campaign(7, repeats=1)
    labels = (local.alpha > 0.08).astype(np.int64)
    out = inner_trims(local, labels)
    used, judged = local.of(~out), local.of(out)
    whole = global_model(local, clusters=2, vehicle="Blown <aircraft>")
    part = global_model(used, clusters=2)
    kinds = [part, semi_local_model(part, problems_of(used)), one_shot_model(part, problems_of(used))]
    time = np.arange(0, 5, 0.02)
    wave = Fit(time, np.sin(time), np.sin(time) + 0.1)
    return CampaignStudy(
        local=local,
        models=(
            whole,
            semi_local_model(whole, problems_of(local)),
            one_shot_model(whole, problems_of(local)),
        ),
        scores=score_held_out(kinds, judged, problems_of(judged)),
        shown=judged.ids[0],
        coefficients={k: {"M": wave} for k in ("local", "global", "semi-local", "one-shot")},
        outputs={k: {"V": wave, "q": wave} for k in ("equation error", "output error")},
        remarks=("Said once.",),
    )


def test_inner_trims_are_never_the_ends_or_stopped():
    local = campaign(7, repeats=1)
    labels = (local.alpha > 0.08).astype(np.int64)
    out = inner_trims(local, labels)
    for k in (0, 1):
        held = local.advance_ratio[(labels == k) & out]
        blown = local.advance_ratio[(labels == k) & np.isfinite(local.advance_ratio)]
        assert 0 < held.size < blown.size - 2
        assert blown.min() < held.min() < held.max() < blown.max()


def test_the_page_of_a_campaign_shows_the_figures_of_its_method(study):
    html = fq.page(study).html
    assert html == fq.page(study).html
    for key in ("laws0", "outputs", "coefficients0", "misfits"):
        assert f'id="{key}' in html
    assert "http" not in re.sub(r"http://www\.w3\.org/[^\"' ]*", "", without_script(html))
    assert "Blown &lt;aircraft&gt;" in html
    for words in ("equation error", "output error", "semi-local", "one-shot", "stopped", "Said once."):
        assert words in html
    for name in ("Cm.0", "Cm.alpha", "Cm.qhat", "Cm.de"):
        assert f"<code>{name}</code>" in html


def test_a_model_has_a_page_a_table_and_a_figure(study, tmp_path):
    model = study.model("semi-local")
    path = fq.save(model, tmp_path / "semi.h5")
    html = fq.page(path).html
    assert "Semi-local model of 14 manoeuvres" in html
    assert 'id="outputs' not in html
    frame = model.to_frame()
    assert len(frame) == 8
    law = model.clusters[0]["Cm.de"]
    row = frame[(frame["derivative"] == "Cm.de")].iloc[0]
    assert row["unblown"] == pytest.approx(law.unblown)
    assert row["lower"] < law.unblown < row["upper"]
    assert set(study.to_frame()["model"]) == {"global", "semi-local", "one-shot"}
    assert model.plot().axes


def test_without_stopped_propellers_the_page_says_extrapolated(study):
    local = study.local.of(np.isfinite(study.local.advance_ratio))
    html = fq.page(replace(global_model(local, clusters=1), vehicle="")).html
    assert "(extrapolated)" in html
    assert "no manoeuvre has stopped propellers" in html

"""Pages of what has no theme of its own: a record, a design file, parameters by output error."""

import numpy as np
import pytest
from test_page import HOSTILE, Page
from test_study_page import aircraft, designed, flown, results

import freqid as fq
from freqid.core.results.fit import Fit
from freqid.core.results.output_error import OutputErrorModel


@pytest.fixture
def dynamic():
    """Two parameters, of which one ended at its bound, and an output with a coloured residual."""
    time = np.arange(200) / 50
    measured = np.sin(time)
    return OutputErrorModel(
        model=HOSTILE,
        method="output-error",
        domain="time",
        names=("M_q", HOSTILE),
        units=("1/s", "1"),
        estimate=np.array([-2.0, 0.5]),
        std_error=np.array([0.1, np.nan]),
        lower=np.array([-2.2, np.nan]),
        upper=np.array([-1.8, np.nan]),
        covariance=np.diag([0.01, np.nan]),
        cramer_rao=np.array([0.05, np.nan]),
        start=np.array([-1.5, 0.1]),
        held={},
        confidence=0.95,
        noise={"q": 0.01},
        process_noise={},
        whiteness={"q": 1e-4},
        coloured=("q",),
        converged=True,
        steps=7,
        cost=12.0,
        at_bound=(HOSTILE,),
        not_excited={},
        inseparable=(),
        fit={"q": Fit(time, measured, 0.9 * measured)},
    )


def test_output_error_shows_parameters_and_what_is_not_white(dynamic, tmp_path):
    page = Page(fq.page(dynamic).html)
    assert page.faults == []
    assert HOSTILE not in fq.page(dynamic).html
    cells = next(t for t in page.cells if any("Cramér-Rao" in cell[0] for cell in t[0]))
    assert [cell[0] for cell in cells[1]][:6] == ["M_q", "1/s", "−2.00", "−2.20", "−1.80", "−1.50"]
    fq.save(dynamic, tmp_path / "one.h5")
    review = fq.review(tmp_path / "one.h5")
    texts = [g.text for g in review.risks]
    assert any("the residuals of q are not white" in text for text in texts)
    assert any("ended at a bound" in text for text in texts)
    assert review.quantities[f"{HOSTILE} M_q"].value == -2.0


def test_a_record_and_a_design_stand_in_their_sections(tmp_path):
    record = flown(results().points[0].model.reference, 1).record
    files = [fq.save(record, tmp_path / "flight.h5"), fq.save(designed(), tmp_path / "design.h5")]
    text = fq.page(files).html
    assert Page(text).faults == []
    data, inputs = (text.index(f'<section id="{name}"') for name in ("data", "excitation"))
    assert text.index('id="data-0-channels"') > data > inputs
    assert "All samples of all" in text
    assert aircraft().name in text
    for file in files:
        assert "Verdict" in fq.page(file).html

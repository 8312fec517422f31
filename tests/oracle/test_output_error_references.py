"""Output error and filter error on real aircraft, held to the published values."""

from __future__ import annotations

import numpy as np
import pytest

MAIN = ("CYb", "Clb", "Clp", "Clda", "Cnb", "Cnr", "Cndr")


@pytest.fixture(scope="module")
def cases(script, shared_data):
    return script("benchmarks/output_error_references.py")


def per_cent(case, name):
    return 100 * abs(case.found[name][0] / case.reference[name] - 1)


def test_twin_otter_in_time(cases, shared_data):
    case = cases.twin_otter_in_time(shared_data)
    assert case.found.converged
    assert len(case.found.names) == 18
    names = case.reference
    off = np.array([abs(case.found[n][0] - case.reference[n]) / case.std_error[n] for n in names])
    assert off.max() <= 1.5
    assert np.sum(off <= 1) >= 17
    ratio = np.array([case.found[n][1] / case.std_error[n] for n in names])
    assert ratio.min() > 0.97
    assert ratio.max() < 1.03
    # R of the reference, and a real flight's residuals are coloured: the product says so
    stored = cases.stored("sidpac", "ex6.1", shared_data)["R_diag"]
    np.testing.assert_allclose(np.square(list(case.found.noise.values())), stored, rtol=0.05)
    assert case.found.coloured


def test_twin_otter_on_lines(cases, shared_data):
    case = cases.twin_otter_on_lines(shared_data)
    assert case.found.converged
    assert max(per_cent(case, n) for n in MAIN) < 2.0
    assert all(abs(case.found[n][0] - case.reference[n]) < 2.5 * case.std_error[n] for n in case.reference)


def test_f16xl_unsteady(cases, shared_data):
    equation_error, case = cases.f16xl(shared_data)
    assert max(map(abs, equation_error.values())) < 1e-3
    assert max(per_cent(case, n) for n in case.reference) < 0.1


def test_attas_short_period(cases, shared_data):
    free = cases.attas(one_start=False, data=shared_data)
    assert max(per_cent(free, n) for n in free.reference) < 1.0
    documented = cases.attas(one_start=True, data=shared_data)
    assert max(per_cent(documented, n) for n in documented.reference) < 0.5


def test_unstable_aircraft(cases, shared_data):
    case = cases.unstable(shared_data)
    assert case.found.converged
    assert max(per_cent(case, n) for n in ("Mw", "Mq")) < 1.0


@pytest.fixture(scope="module")
def filtered_hfb_320(cases, shared_data):
    return cases.hfb320("filter-error", shared_data)


@pytest.mark.slow
def test_hfb_320_output_error_is_said_to_be_invalid_and_filter_error_takes_the_bias_away(
    cases, shared_data, filtered_hfb_320
):
    plain = cases.hfb320("output-error", shared_data)
    assert not plain.found.valid
    assert set(plain.found.coloured) == set(plain.found.noise)
    assert any("output error is not valid here" in remark for remark in plain.found.remarks)
    assert 20 < per_cent(plain, "CLal") < 30
    filtered = filtered_hfb_320
    assert filtered.found.converged
    assert per_cent(filtered, "CLal") < 5
    assert per_cent(filtered, "Cmal") < 5
    # the states that turbulence drives are predicted with white innovations, what output error never has
    assert {"V", "theta", "q"} <= set(filtered.found.noise) - set(filtered.found.coloured)


@pytest.mark.xfail(strict=True, reason="6.5 % off; docs/theory/output-error.md says what was tried")
def test_hfb_320_elevator_effectiveness_by_filter_error(filtered_hfb_320):
    assert per_cent(filtered_hfb_320, "Cmde") < 5

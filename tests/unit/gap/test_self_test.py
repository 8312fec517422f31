"""The self-test beside closed forms, a dense likelihood and brute-force loops, on a linear aircraft."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from linear_flight import LIBRARY, SIZES, Linear, effect, fly
from scipy.stats import ncx2

from freqid.core.errors import DataError
from freqid.core.gap_self_test import Rate
from freqid.gap.attribute import LEAST_ODDS, NONE, OTHER, critical, existence, judge, p_value, variants
from freqid.gap.calibrate import Table
from freqid.gap.compare import compare
from freqid.gap.gather import evidence_of
from freqid.gap.inserted import insert, places
from freqid.gap.reach import reach
from freqid.gap.self_test import STRATA, self_test
from freqid.gap.signature import made
from freqid.gap.weighed_draws import weigh

DRAWS = 200
TOLERANT = {**SIZES, "derivatives": 0.02, "dynamics": 0.02}


def compared(library, sizes, seeds=(1,), count=DRAWS):
    return [
        compare(Linear(), fly(noise=1.0, seed=s, phases=s), library, sizes, (0.1, 2.0), count=count, seed=s)
        for s in seeds
    ]


@pytest.fixture(scope="module")
def tolerant():
    used = compared(LIBRARY, TOLERANT, (1, 2))
    evidence = evidence_of(used, apart=True)
    judged = judge(evidence, LIBRARY)
    inserted = insert(LIBRARY, used, evidence, places(LIBRARY, evidence, used), STRATA)
    return used, evidence, judged, inserted


@pytest.fixture(scope="module")
def tested(tolerant):
    used, evidence, judged, _ = tolerant
    return self_test(used, evidence, judged, LIBRARY, Table(), 0.02)


def test_power_of_a_lone_effect_is_that_of_a_noncentral_chi_square():
    alone = {"worn": LIBRARY["worn"]}
    used = compared(alone, SIZES)
    evidence = evidence_of(used)
    where = places(alone, evidence, used)
    inserted = insert(alone, used, evidence, where, STRATA)
    threshold = critical(existence(judge(evidence, alone))[1], 0.02)
    (found,) = reach(inserted.evidence, alone, inserted.insertions, threshold, {"worn:share": 0.0})
    # with one explanation the statistic is z^2 w / (2 (1 + w)) - log(1 + w) / 2, z normal about sqrt(lambda)
    width = where[0].gain * LIBRARY["worn"].parameters["share"].scale ** 2
    asked = (2 * threshold + np.log1p(width)) * (1 + width) / width
    spread = evidence.null_products(evidence.column("worn:share")).var() / where[0].gain  # of z in the draws
    power = ncx2.sf(asked / spread, 1, found.detectability / spread)
    assert power == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / DRAWS))
    # the effect is linear here: its size is that of its detectability
    assert found.size == pytest.approx(np.sqrt(found.detectability / where[0].gain), rel=1e-6)


def part_of(c, k, name):
    """Return a signature or tolerance of the k-th manoeuvre, in the one row or manoeuvre of its name."""
    plain, where = re.fullmatch(r"([^@#]*)(.*)", name).groups()
    whole = {**c.signatures, **c.common}[plain]
    if where.startswith("@"):
        return whole * (where == f"@{k}")
    alone = [not where or where == f"#{row.name}" for row in c.rows]
    return whole * np.array(alone)[:, None]


def white_of(used, evidence):
    """Return white signatures and tolerances of all manoeuvres, one after the other."""
    names = (*evidence.signatures, *evidence.tolerances)
    columns = [[c.white(part_of(c, k, n)) for k, c in enumerate(used)] for n in names]
    every = np.array([np.concatenate(one) for one in columns])
    return every[: len(evidence.signatures)], every[len(evidence.signatures) :]


def white_change(used, one, size):
    """Return what an effect does at a size, by its full formula."""
    settings = {one.place.name: one.place.sign * size}
    each = [made(LIBRARY[one.place.effect], c.trial, settings) for c in used]
    return np.concatenate([c.white(c.lines.transform(z)) for c, z in zip(used, each, strict=True)])


def test_the_size_that_is_found_is_found_by_a_loop_over_residuals(tolerant):
    """Each draw as a residual of its own, the effect by its full formula, judged one by one."""
    used, evidence, judged, inserted = tolerant
    _, null = existence(judged)
    nothing = dict.fromkeys(evidence.signatures, 0.0)
    sizes = reach(inserted.evidence, LIBRARY, inserted.insertions, critical(null, 0.02), nothing)
    size = next(r.size for r in sizes if r.effect == "late")
    one = next(i for i in inserted.insertions if i.place.effect == "late")
    signatures, allowed = white_of(used, evidence)
    change = white_change(used, one, size)
    projected = np.linalg.solve(
        np.eye(change.size) + allowed.T @ allowed, np.vstack([signatures, allowed]).T
    ).T
    noise = np.concatenate([c.white_draws for c in used], axis=1)
    found = 0
    for draw, tolerances in zip(noise, evidence.null, strict=True):
        products = np.zeros((len(evidence.metric), 1))
        products[1 : 1 + len(projected), 0] = projected @ (draw + tolerances @ allowed + change)
        before = np.concatenate([[0.0], [evidence.null_products(k)[0] for k in range(1, len(products))]])
        shifted = evidence.with_added(np.array([0]), products - before[:, None])
        statistic = existence(judge(shifted, LIBRARY))[1][0]
        found += p_value(statistic, null) < 0.02 and statistic > LEAST_ODDS
    assert found / DRAWS == pytest.approx(0.95, abs=0.02)


def test_evidence_of_an_insertion_is_a_ratio_of_dense_likelihoods(tolerant):
    used, evidence, _, inserted = tolerant
    middle = inserted.insertions[1::3]
    weighed = weigh(inserted.evidence, LIBRARY, middle, 50.0, 0.0, 0)
    signatures, allowed = white_of(used, evidence)
    noise = np.concatenate([c.white_draws for c in used], axis=1)
    before = np.eye(allowed.shape[1]) + allowed.T @ allowed

    def minus_twice_log(data, covariance):
        root = np.linalg.cholesky(covariance)
        return (np.linalg.solve(root, data) ** 2).sum() + 2 * np.log(np.diag(root)).sum()

    for case in (3, DRAWS + 40, 4 * DRAWS + 7):
        k = int(weighed.draw[case])
        one = next(i for i in middle if i.place.effect == weighed.truth[case])
        change = white_change(used, one, one.size)
        change *= np.sqrt(50.0 / (change @ np.linalg.solve(before, change)))
        data = noise[k] + evidence.null[k] @ allowed + change
        none = minus_twice_log(data, before)
        for i, name in enumerate(weighed.names):
            if name == OTHER:
                continue
            dense = []
            for hypothesis in variants(LIBRARY[name], evidence):
                scaled = signatures[[k - 1 for k in hypothesis.columns]] * np.array(hypothesis.scale)[:, None]
                dense.append((none - minus_twice_log(data, before + scaled.T @ scaled)) / 2)
            expected = np.logaddexp.reduce(dense) - np.log(len(dense))
            assert weighed.evidence[case, i] == pytest.approx(expected, abs=1e-5)


def test_insertions_have_the_detectability_that_was_asked_for(tolerant):
    used, evidence, _, inserted = tolerant
    _, allowed = white_of(used, evidence)
    inner = np.eye(len(allowed)) + allowed @ allowed.T
    for one in inserted.insertions:
        change = white_change(used, one, one.size)
        left = change - allowed.T @ np.linalg.solve(inner, allowed @ change)
        assert one.detectability == pytest.approx(change @ left, rel=1e-6)
        assert min(abs(np.log(one.detectability / goal)) for goal in STRATA) < 0.25
    assert len(inserted.insertions) == len(STRATA) * len(LIBRARY)


def test_what_is_plain_is_named_and_what_is_nothing_is_not(tested):
    result = tested.result
    strongest = result.strata[-1]
    assert strongest.detectability == 200.0
    assert strongest.detected.share > 0.99
    assert strongest.right.share > 0.95
    assert result.false_alarm.share < 0.06
    assert [s.detected.share for s in result.strata] == sorted(s.detected.share for s in result.strata)
    for s in result.strata:
        assert all(sum(row.values()) == DRAWS for row in s.answers.values())
        assert set(s.answers) == set(LIBRARY)


def test_counts_agree_with_one_another(tested):
    for s in tested.result.strata:
        detected = s.detected.count
        assert s.detected.of == DRAWS * len(LIBRARY)
        assert s.named.of == s.covered.of == detected
        assert s.right.of == s.named.count
        on_diagonal = sum(row.get(name, 0) for name, row in s.answers.items())
        assert on_diagonal == s.right.count
    outside = tested.result.outside
    assert sum(r.count for r in outside.values()) == outside["named"].of


def test_calibration_helps_where_it_was_not_fitted_and_sets_hold_the_truth(tested):
    assert tested.result.score["after"] <= tested.result.score["before"]
    assert tested.table.calibrated
    assert tested.table.source == "self-test"
    assert tested.table.form_error == Table().form_error
    held = sum(s.covered.count for s in tested.result.strata) / sum(
        s.covered.of for s in tested.result.strata
    )
    assert held > 0.85


def test_twins_count_as_one_name(tolerant):
    twin = replace(LIBRARY["worn"], id="twin")
    library = {**LIBRARY, "twin": twin}
    used = compared(library, TOLERANT, (1, 2), count=60)
    evidence = evidence_of(used)
    found = self_test(used, evidence, judge(evidence, library), library, Table(), 0.02).result
    row = found.strata[-1].answers["twin"]
    assert row["twin"] > 50
    assert "worn" not in row


def test_an_effect_that_ends_before_it_shows_is_not_found_at_any_size():
    short = effect("worn", "share", 0.1, feel=LIBRARY["worn"].feel)
    short = replace(short, parameters={"share": replace(short.parameters["share"], low=0.0, high=1e-3)})
    library = {"worn": short, "late": LIBRARY["late"]}
    used = compared(library, TOLERANT, count=60)
    evidence = evidence_of(used)
    found = self_test(used, evidence, judge(evidence, library), library, Table(), 0.02).result
    worn = next(r for r in found.reach if r.effect == "worn")
    assert np.isnan(worn.size)
    assert worn.largest == pytest.approx(1e-3)
    assert all("worn" not in s.answers for s in found.strata)


def test_an_effect_that_breaks_at_such_a_size_is_said_to_be_left_out(tolerant):
    used, evidence, judged, _ = tolerant

    def breaks(settings, described):
        if abs(settings["fraction"]) > 1e-9:
            raise ValueError("no such vehicle")
        return described

    library = {**LIBRARY, "heavy": replace(LIBRARY["heavy"], load=breaks)}
    found = self_test(used, evidence, judged, library, Table(), 0.02).result
    assert found.not_inserted == {"heavy": "effect 'heavy': no such vehicle."}
    alone = {"heavy": library["heavy"]}
    with pytest.raises(DataError, match="no effect can be inserted"):
        self_test(used, evidence, judged, alone, Table(), 0.02)


def test_null_draws_are_weighed_as_they_were_judged(tolerant):
    _, evidence, judged, _ = tolerant
    weighed = weigh(evidence, LIBRARY, (), 0.0, 0.0, 0)
    assert set(weighed.truth) == {NONE}
    known = {j.name: j.null for j in judged}
    for i, name in enumerate(weighed.names):
        assert weighed.evidence[:, i] == pytest.approx(known[name])


@pytest.mark.parametrize(
    ("count", "of", "lo", "hi"), [(0, 0, 0.0, 1.0), (5, 10, 0.2366, 0.7634), (0, 20, 0.0, 0.1611)]
)
def test_rates_have_wilson_intervals(count, of, lo, hi):
    rate = Rate.over(k < count for k in range(of))
    assert (rate.count, rate.of) == (count, of)
    assert rate.lo == pytest.approx(lo, abs=1e-4)
    assert rate.hi == pytest.approx(hi, abs=1e-4)

"""A small part of `benchmarks/fuzz.py`: damaged files of every kind end in one sentence."""

from collections import Counter

import pytest

from freqid.core.errors import UncheckedFile

CASES = 25
pytestmark = pytest.mark.filterwarnings("ignore::freqid.core.errors.UncheckedFile")


@pytest.fixture(scope="module")
def fuzz(script):
    return script("benchmarks/fuzz.py")


@pytest.fixture(scope="module")
def subjects(fuzz, tmp_path_factory):
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UncheckedFile)
        return {s.name: s for s in fuzz.subjects(tmp_path_factory.mktemp("good"))}


def outcomes(fuzz, subject, folder):
    good = folder / f"good{subject.suffix}"
    good.write_bytes(subject.good)
    expected = fuzz.contents(subject.read(good))
    found = []
    for number in range(100_000, 100_000 + CASES):  # other cases than the benchmark's
        became, said = fuzz.outcome(subject, fuzz.case_of(subject, number), folder, expected)
        assert became not in fuzz.FAULTS, f"{subject.name}, case {number}: {said}"
        found.append(became)
    return Counter(found)


@pytest.mark.parametrize("name", ["record", "design", "point", "global", "response", "gap", "rivals"])
def test_no_changed_number_of_ours_is_accepted(fuzz, subjects, tmp_path, name):
    found = outcomes(fuzz, subjects[name], tmp_path)
    assert found["other"] == 0
    assert found["refused"] >= 0.8 * CASES  # the others are files in which nothing was changed


@pytest.mark.parametrize(
    "name",
    [
        *["csv", "MAT 5", "MAT 7, compressed", "SIDPAC", "Parquet", "ULog", "DataFlash"],
        *["scenario linear, read and checked", "scenario tiltrotor, read and checked"],
        *["column map", "loop", "effects"],
    ],
)
def test_a_damaged_file_is_read_or_refused_in_one_sentence(fuzz, subjects, tmp_path, name):
    found = outcomes(fuzz, subjects[name], tmp_path)
    assert found["refused"] > 0

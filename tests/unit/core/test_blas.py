"""Products on one thread while a verb works, and the user's own number of threads where there is one."""

from __future__ import annotations

import pickle

import numpy  # noqa: F401  its BLAS is what is limited
import pytest
import threadpoolctl

import freqid as fq
from freqid.core import blas
from freqid.workflows import connect


def threads(_=None):
    return {pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"}


@pytest.fixture
def two_threads(monkeypatch):
    for name in blas._OWN:
        monkeypatch.delenv(name, raising=False)
    with threadpoolctl.threadpool_limits(limits=2, user_api="blas"):
        if threads() != {2}:
            pytest.skip("this machine's BLAS has one thread")
        yield


def test_a_call_has_one_thread_and_leaves_as_many_as_there_were(two_threads):
    assert blas.on_one_thread(threads)() == {1}
    assert threads() == {2}


def test_after_an_error_there_are_as_many_as_before(two_threads):
    with pytest.raises(ZeroDivisionError):
        blas.on_one_thread(lambda: 1 / 0)()
    assert threads() == {2}


def test_a_number_that_the_user_has_set_stands(two_threads, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    assert blas.on_one_thread(threads)() == {2}


def test_what_the_command_line_sets_holds_though_numpy_was_loaded_before(two_threads, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    assert blas.on_one_thread(threads)() == {1}


@pytest.mark.parametrize("verb", [fq.diagnose_gap, fq.check_sensors, fq.identify_point, fq.study])
def test_a_verb_goes_to_another_process_by_its_name(verb):
    assert pickle.loads(pickle.dumps(verb)) is verb


def test_a_verb_works_on_one_thread(two_threads, monkeypatch):
    seen = set()
    monkeypatch.setattr(connect, "several", lambda _: seen.update(threads()) or [])
    with pytest.raises(IndexError):  # there is no flight
        fq.check_simulation(None, ())
    assert seen == {1}

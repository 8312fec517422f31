"""A function is asked again where something that it read is another, and only then."""

from __future__ import annotations

import gc
import json

import pytest

from freqid.gap.connect.what_is_read import Answers, Noted


class About:
    """Something that answers are about."""


class Counted:
    """A function of parameters that counts how often it is asked."""

    def __init__(self, function):
        self.function, self.asked, self.answers, self.about = function, 0, Answers(), About()

    def __call__(self, **parameters):
        return self.answers.of(self.about, parameters, self._ask)

    def _ask(self, parameters):
        self.asked += 1
        return self.function(parameters)


def test_parameters_that_are_not_read_do_not_matter():
    servo = Counted(lambda p: 2 * p["gain"])
    assert [servo(gain=1.0, lift=x) for x in (0.0, 0.1, -0.1)] == [2.0, 2.0, 2.0]
    assert servo.asked == 1
    assert servo(gain=3.0, lift=0.0) == 6.0
    assert servo(gain=1.0, lift=7.0) == 2.0
    assert servo.asked == 2


def test_what_is_read_on_a_condition_is_seen_where_the_condition_holds():
    servo = Counted(lambda p: p["slow"] if p["mode"] else 0.0)
    assert [servo(mode=0, slow=x) for x in (1.0, 2.0)] == [0.0, 0.0]
    assert [servo(mode=1, slow=x) for x in (1.0, 2.0)] == [1.0, 2.0]
    assert servo.asked == 3


def test_a_name_that_is_not_there_is_read_too():
    servo = Counted(lambda p: p.get("lag", 0.0) + ("late" in p))
    assert [servo(), servo(lag=1.0), servo(lag=1.0, late=0.0), servo()] == [0.0, 1.0, 2.0, 0.0]
    assert servo.asked == 3


@pytest.mark.parametrize(
    "of_all",
    [
        lambda p: sum(p.values()),
        lambda p: sum(x for _, x in p.items()),
        lambda p: sum({**p}.values()),
        lambda p: sum(dict(p).values()),
        lambda p: sum(p.copy().values()),
        lambda p: (lambda a, b: a + b)(**p),
        lambda p: sum(json.loads(json.dumps(p)).values()),
        lambda p: p["a"] + p.pop("b"),
    ],
)
def test_who_takes_all_at_once_is_always_asked(of_all):
    servo = Counted(of_all)
    assert [servo(a=1, b=x) for x in (1, 2, 1)] == [2, 3, 2]


def test_whether_there_are_any_is_a_question_of_all():
    noted = Noted({"a": 0.0})
    assert noted
    assert noted.whole


def test_answers_are_kept_by_what_they_are_about_and_no_longer():
    answers, one, other = Answers(), About(), About()
    assert answers.of(one, {}, lambda _: 1) == 1
    assert answers.of(other, {}, lambda _: 2) == 2
    assert answers.of(one, {}, lambda _: 3) == 1
    del one
    gc.collect()
    assert len(answers._known) == 1

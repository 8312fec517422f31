"""Progress on a terminal: bars, and a line that is written over; a few lines in a job's log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

import click

_SELDOM = 10.0  # s between lines in a log


def bar(what: str, unit: str) -> Callable[[int, int], None]:
    """Return what draws a bar when told how many are done of how many, and removes it at the end."""
    from tqdm import tqdm

    drawn = tqdm(desc=what, unit=unit, disable=None, leave=False)

    def progress(done: int, total: int) -> None:
        drawn.total = total
        drawn.update(done - drawn.n)
        if done >= total:
            drawn.close()

    return progress


def watched(found: Iterable[Any], what: str, count: int) -> Iterable[Any]:
    """Pass results on with a bar of how many there are."""
    from tqdm import tqdm

    return tqdm(found, desc=what, total=count, disable=None, leave=False)


def line() -> Callable[[str], None]:
    """Return what tells of progress: on a terminal a line that is written over.

    Elsewhere, as in a job's log, one every ten seconds at most, with the time since the start.
    """
    if sys.stderr.isatty():
        return lambda text: click.echo(f"\r\033[K{text}", nl=False, err=True)
    began = said = time.monotonic()

    def progress(text: str) -> None:
        nonlocal said
        now = time.monotonic()
        if text and now - said >= _SELDOM:
            said = now
            click.echo(f"{_duration(now - began)}: {text}", err=True)

    return progress


def paced(what: str) -> Callable[[int, int], None]:
    """Return what tells how many are done, how fast, and how long the rest will take.

    On a terminal a line is written over; elsewhere, as in the log of a cluster's job, there is one every ten
    seconds.
    """
    terminal = sys.stderr.isatty()
    began, first, said = 0.0, -1, float("-inf")

    def progress(done: int, total: int) -> None:
        nonlocal began, first, said
        now = time.monotonic()
        if first < 0:  # what was done before this run says nothing of its rate
            began, first = now, done
        if now - said < (0.2 if terminal else _SELDOM) and done < total:
            return
        said = now
        text = f"{done} of {total} {what}"
        if done > first:
            rate = (done - first) / (now - began)
            text += f", {rate:.3g} a second"
            if done < total:
                text += f", {_duration((total - done) / rate)} left"
        click.echo(f"\r\033[K{text}" if terminal else text, nl=not terminal or done >= total, err=True)

    return progress


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"

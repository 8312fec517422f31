"""Progress on a terminal: bars, and a line that is written over; nothing elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from typing import Any

import click


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
    """Return what tells of progress: a line on a terminal that is written over, nothing elsewhere."""
    if not sys.stderr.isatty():
        return lambda text: None
    return lambda text: click.echo(f"\r\033[K{text}", nl=False, err=True)

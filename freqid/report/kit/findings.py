"""Sentences of a verdict: what kind each is of, and how its parts are put together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from markupsafe import Markup


@dataclass(frozen=True)
class Finding:
    """One sentence of the verdict.

    Attributes
    ----------
    kind : {"good", "note", "bad"}
        Nothing to do; worth knowing; to be answered before the model is used.
    text : Markup
    label : str
        Word that stands before it, in place of that of its kind.
    """

    kind: Literal["good", "note", "bad"]
    text: Markup
    label: str = ""


def finding(kind: Literal["good", "note", "bad"], text: str, *parts: object) -> Finding:
    """Return a sentence with its parts filled in and escaped."""
    return Finding(kind, Markup(text).format(*parts))


def code(name: str) -> Markup:
    """Return a name as the page sets names."""
    return Markup("<code>{}</code>").format(name)


def listed(items: Iterable[Markup]) -> Markup:
    """Join items as a sentence does: a, b and c."""
    items = list(items)
    if len(items) < 2:
        return Markup("").join(items)
    return Markup(", ").join(items[:-1]) + Markup(" and ") + items[-1]

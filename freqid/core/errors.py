"""Errors that a user can act on, and the exit code each one ends a command with.

An error is one sentence that says where (file), what (channel or key), what was found,
what was expected and what to do. The parts stay available as attributes.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

EXIT_GOOD = 0
EXIT_USAGE = 2
EXIT_DATA = 3
EXIT_GATE = 4
EXIT_BUG = 70


class FreqidError(Exception):
    """Base of every error that freqid raises on purpose.

    Parameters
    ----------
    message : str
        What is wrong, as one sentence without the final full stop.
    where : str, optional
        The file, or the place inside it, that the sentence is about.
    remedy : str, optional
        What the reader can do about it.
    """

    exit_code = EXIT_BUG

    def __init__(self, message: str, *, where: str | None = None, remedy: str | None = None):
        self.message = message
        self.where = where
        self.remedy = remedy
        super().__init__(str(self))

    def __str__(self) -> str:
        text = f"{self.where}: {self.message}" if self.where else self.message
        text = f"{text}; {self.remedy}" if self.remedy else text
        # names from damaged or hostile files may hold line ends, or codes that a terminal obeys
        text = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
        return text if text.endswith(("?", "...")) else f"{text}."

    def at(self, where: str) -> FreqidError:
        """Return the same error with its place filled in, unless it has one already."""
        return type(self)(self.message, where=self.where or where, remedy=self.remedy)


class UsageError(FreqidError):
    """The request cannot be met as it was put: an option, an argument, a scenario key."""

    exit_code = EXIT_USAGE


class DataError(FreqidError):
    """The data cannot be read, or contradict themselves or the request."""

    exit_code = EXIT_DATA


class ImpossibleSettings(DataError):
    """Nothing can be as it was asked to be, as a body whose one moment of inertia exceeds the others' sum."""


class GateFailed(FreqidError):
    """The work is finished and written, but a gate of the scenario is not met."""

    exit_code = EXIT_GATE


class UncheckedFile(UserWarning):
    """A file of an earlier release has no checksum: what is read may have been changed since."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a clause that suggests the nearest known names, or lists them where few.

    Examples
    --------
    >>> nearest("elevater", ["elevator", "aileron"])
    "did you mean 'elevator'?"
    """
    names = sorted(set(known))
    close = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    if not close:  # one-letter slips in short names such as de1 or p fall below the cutoff
        close = [k for k in names if k.lower() == name.lower()]
    if close:
        return "did you mean " + " or ".join(f"'{k}'" for k in close) + "?"
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"known names are: {shown}" if names else "no names are known here"

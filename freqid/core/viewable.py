"""Results that show themselves: as a table, a figure, and in a notebook.

Tables and figures stay at the doors: pandas and matplotlib are loaded by ``freqid.views`` when they are asked
for, which is why its modules are named here by strings and not imported.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


class Viewable:
    """A result with a table, a figure and an HTML summary."""

    __slots__ = ()

    def to_frame(self) -> Any:
        """Return the result as a `pandas.DataFrame`.

        Records and designs give samples by channel over time in s; models a row for each parameter; diagnoses
        one for each explanation; frequency responses one for each pair and line. Units are in the column's
        name, or in a column of their own.
        """
        return import_module("freqid.views.tables").frame_of(self)

    def plot(self) -> Any:
        """Return the result drawn, as a `matplotlib.figure.Figure`."""
        return import_module("freqid.views.figures").figure_of(self)

    def _repr_html_(self) -> str:
        return import_module("freqid.views.notebook").html_of(self)

"""A figure as markup that can stand in a page beside others of its kind."""

from __future__ import annotations

import io
import re
import warnings

import matplotlib.style
from markupsafe import Markup
from matplotlib.figure import Figure

from freqid.report.kit.drawing import STYLE

_LARGEST = 1.1  # times the size that it was drawn in; its text would outgrow the page's
# All that matplotlib would say about itself and the time of day.
_SILENT = {"Date": None, "Creator": None, "Format": None, "Type": None}


def inline_svg(figure: Figure, key: str, label: str) -> Markup:
    """Return a figure as an ``<svg>`` element.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    key : str
        Unique in the page; every id of the figure begins with it.
    label : str
        What a reader who cannot see the figure is told.

    Returns
    -------
    Markup
        Scales with its container; the same bytes for the same figure.
    """
    buffer = io.StringIO()
    with matplotlib.style.context(["default", STYLE | {"svg.hashsalt": key}]), warnings.catch_warnings():
        # Text stays text: a glyph that matplotlib's font lacks is drawn by the reader's.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format="svg", metadata=_SILENT)
    width, height = 72 * figure.get_size_inches()
    content = buffer.getvalue()
    content = content[content.index(">", content.index("<svg")) + 1 :]
    # Its one rule would hold for the whole page, which states it once itself.
    content = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", content, count=1, flags=re.DOTALL)
    content = re.sub(r"<!--.*?-->\s*", "", content, flags=re.DOTALL)
    content = re.sub(r"font-family: [^;\"]*;?|font: (?=[\d.]+px [^;\"]*)", "", content)
    content = _with_unique_ids(content, key)
    content = re.sub(r'(?<= d=")[^"]*', _rounded, content)
    opening = Markup(
        '<svg viewBox="0 0 {:.6g} {:.6g}" style="max-width: {:.0f}pt" role="img" aria-label="{}">'
    )
    return opening.format(width, height, _LARGEST * width, label) + Markup(content)


def _with_unique_ids(content: str, key: str) -> str:
    """Keep only the ids that are referred to, and begin them with the key."""
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', content))
    content = re.sub(
        r' id="([^"]*)"', lambda match: f' id="{key}-{match[1]}"' if match[1] in used else "", content
    )
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{key}-", content)


def _rounded(path: re.Match[str]) -> str:
    """Return path data to a hundredth of a point, finer than any screen."""
    return re.sub(r"-?\d+\.\d+", lambda match: f"{float(match[0]):.2f}".rstrip("0").rstrip("."), path[0])

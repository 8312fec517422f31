"""A figure as an ``<svg>`` element of a page: small, with unique ids, and with panels that can be zoomed.

What matplotlib writes is rewritten, not only shortened. Colours become attributes, so that the page's style
can replace them in the dark while a saved figure keeps them; paths become relative, equal neighbours become
one; and panels over time say which span they show, so that the page's script can zoom them.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from xml.etree import ElementTree

import matplotlib.style
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from freqid.report.kit.drawing import INK, STYLE, TIME_PANEL, WIDTH

_LARGEST = 1.2  # times the size that it was drawn in; its text would outgrow the page's
_LEGIBLE = 1.31  # pixels for each point of a figure that is scrolled: 8.5 points are 11.1 pixels high
# All that matplotlib would say about itself and the time of day.
_SILENT = {"Date": None, "Creator": None, "Format": None, "Type": None}
_FONT = f"{STYLE['font.size']:g}"
_LONG = 100  # points of a line that is worth zooming: its times keep a digit more
# What the root says for all, and what is the default anyway.
_INHERITED = {"stroke-linejoin": "round", "stroke-linecap": "butt", "font-size": _FONT, "fill": INK}
_SAID = {
    *((name, value) for name, value in _INHERITED.items() if name.startswith("stroke")),
    *(
        ("stroke-miterlimit", "100000"),
        ("stroke-dashoffset", "0"),
        ("font-style", "normal"),
        ("font-weight", "normal"),
    ),
}
_TICK = re.compile(r"[xy]tick_\d+")


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
    for axes in figure.axes:
        if axes.get_gid() == TIME_PANEL:
            axes.set_gid("{} {:.10g} {:.10g}".format(TIME_PANEL, *axes.get_xlim()))
            axes.xaxis.set_gid("x")
            axes.yaxis.set_gid("y")
    buffer = io.StringIO()
    with matplotlib.style.context(["default", STYLE | {"svg.hashsalt": key}]), warnings.catch_warnings():
        # Text stays text: a glyph that matplotlib's font lacks is drawn by the reader's.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format="svg", metadata=_SILENT)
    drawn = ElementTree.fromstring(buffer.getvalue())
    width, height = 72 * figure.get_size_inches()
    content = "".join(_write(child) for child in _Rewriter(drawn, key).children())
    size = f"max-width: {_LARGEST * width:.0f}pt"
    if width > 72 * 1.02 * WIDTH:
        size = f"max-width: {width:.0f}pt; min-width: {_LEGIBLE * width:.0f}px"
    opening = Markup(
        '<svg viewBox="0 0 {:.6g} {:.6g}" style="{}" role="img" aria-label="{}" '
        'font-size="{}" fill="{}" stroke-linejoin="round">{}</svg>'
    )
    return opening.format(width, height, size, label, _FONT, INK, Markup(content))


class _Rewriter:
    """Rewrites what matplotlib drew, element by element, in place."""

    def __init__(self, drawn: ElementTree.Element, key: str) -> None:
        self.drawn = drawn
        for element in drawn.iter():
            element.tag = element.tag.rpartition("}")[2]
            element.attrib = {name.rpartition("}")[2]: value for name, value in element.attrib.items()}
        referred = [
            found
            for element in drawn.iter()
            for value in (element.get("href", ""), element.get("clip-path", ""), element.get("style", ""))
            for found in re.findall(r"#([\w-]+)\)?$", value)
        ]
        self.ids = {old: f"{key}-{i}" for i, old in enumerate(dict.fromkeys(referred))}

    def children(self) -> list[ElementTree.Element]:
        """Return what stands in the ``<svg>``."""
        root = ElementTree.Element("svg")
        root.extend(self._children(self.drawn, in_time=False))
        return list(_joined(root))

    def _children(self, parent: ElementTree.Element, in_time: bool) -> Iterator[ElementTree.Element]:
        """Rewrite the children of an element; groups that say nothing are replaced by what is in them."""
        for child in parent:
            if child.tag in ("style", "metadata") or _is_paper(child):
                continue
            if child.tag == "defs" and not any(inner.tag != "style" for inner in child):
                continue
            if child.tag == "clipPath" and child.get("id") not in self.ids:
                continue
            name = child.attrib.pop("id", None)
            if name in self.ids:
                child.set("id", self.ids[name])
            time = (name or "").startswith(f"{TIME_PANEL} ")
            if time and name:
                child.attrib |= {"class": "time", "data-span": name.partition(" ")[2]}
            elif in_time and name in ("x", "y"):
                child.set("class", name)
            elif in_time and name and _TICK.fullmatch(name):
                child.set("class", "tick")
            inner = list(self._children(child, in_time or time))
            if child.tag == "g" and not child.attrib:
                yield from inner
                continue
            child[:] = inner
            self._attributes(child, in_time)
            if child.tag in ("g", "defs"):
                if not inner:
                    continue
                child[:] = list(_joined(child))
            yield child

    def _attributes(self, element: ElementTree.Element, in_time: bool) -> None:
        """Turn styles into attributes, references into the page's ids, and numbers into short ones."""
        for part in element.attrib.pop("style", "").split(";"):
            name, _, value = (text.strip() for text in part.partition(":"))
            if name == "font":  # of formulas: size and family
                size = re.search(r"[\d.]+(?=px)", value)
                name, value = "font-size", size[0] if size else _FONT
            if name == "font-size":
                value = value.removesuffix("px")
            if name and name != "font-family" and (name, value) not in _SAID:
                element.set(name, value)
        if element.tag == "text" or element.tag == "tspan":
            for name in ("fill", "font-size"):
                if element.get(name) == _INHERITED[name]:
                    del element.attrib[name]
            if element.get("text-anchor") == "start":
                del element.attrib["text-anchor"]
        if (turn := re.match(r"rotate\((-?[\d.]+)[ ,)]", element.get("transform", ""))) and not float(
            turn[1]
        ):
            del element.attrib["transform"]
        for name in ("href", "clip-path"):
            if name in element.attrib:
                element.set(
                    name, re.sub(r"#([\w-]+)", lambda at: f"#{self.ids[at[1]]}", element.get(name, ""))
                )
        for name in ("x", "y", "width", "height"):
            if name in element.attrib:
                element.set(name, " ".join(_short(float(x)) for x in element.get(name, "").split()))
        if "d" in element.attrib:
            element.set("d", relative(element.get("d", ""), finer=in_time))


def _is_paper(element: ElementTree.Element) -> bool:
    """Whether an element is a figure's or a panel's white ground: the page is its paper."""
    style = element.get("style", "").replace(" ", "")
    return (
        element.tag == "path"
        and style in ("fill:#ffffff", "fill:#ffffff;stroke:#ffffff;stroke-linejoin:miter", "fill:none")
        and element.get("clip-path") is None
    )


def _joined(parent: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """Join neighbours that look the same: paths into one, marks into a group that says once how they look."""
    group: ElementTree.Element | None = None
    for child in parent:
        look = {name: value for name, value in child.attrib.items() if name not in ("d", "x", "y", "id")}
        if group is not None and child.tag == "path" == group.tag and _may_join(group, child, look):
            group.set("d", group.get("d", "") + child.get("d", ""))
            continue
        if group is not None and child.tag == "use" and group.tag == "g" and group.get("_look") == repr(look):
            group.append(_bare(child))
            continue
        if group is not None:
            yield _finished(group)
            group = None
        if child.tag == "path":
            group = child
        elif child.tag == "use":
            group = ElementTree.Element(
                "g", {"_look": repr(look)} | {k: v for k, v in look.items() if k != "href"}
            )
            group.append(_bare(child))
        else:
            yield child
    if group is not None:
        yield _finished(group)


def _may_join(first: ElementTree.Element, second: ElementTree.Element, look: dict[str, str]) -> bool:
    """Whether two paths are one to the eye: they look the same, cover nothing twice and are no long lines."""
    if "id" in first.attrib or "id" in second.attrib or "opacity" in repr(look):
        return False
    if {name: value for name, value in first.attrib.items() if name != "d"} != look:
        return False
    return len(second.get("d", "")) < _LONG


def _bare(mark: ElementTree.Element) -> ElementTree.Element:
    mark.attrib = {name: mark.attrib[name] for name in ("href", "x", "y") if name in mark.attrib}
    return mark


def _finished(group: ElementTree.Element) -> ElementTree.Element:
    group.attrib.pop("_look", None)
    if group.tag == "g" and len(group) == 1:
        only = group[0]
        only.attrib |= group.attrib
        return only
    return group


_TOKEN = re.compile(r"[A-Za-z]|-?[\d.]+(?:e-?\d+)?")
_POINTS = {"M": 1, "L": 1, "Q": 2, "C": 3}


def relative(path: str, finer: bool = False) -> str:
    """Return path data with relative commands, to a hundredth of a point.

    Parameters
    ----------
    path : str
        Commands M, L, Q, C and Z, absolute.
    finer : bool
        Whether the horizontal places of a long line keep a thousandth, for whoever zooms in.

    Returns
    -------
    str
        The same points to rounding, which does not add up along the path.
    """
    tokens = _TOKEN.findall(path)
    across = 1000 if finer and len(tokens) > 3 * _LONG else 100
    out: list[str] = []
    at = start = (0, 0)
    last, i = "", 0
    while i < len(tokens):
        command = tokens[i].upper()
        if command == "Z":
            out.append("z")
            at, last, i = start, "z", i + 1
            continue
        count = _POINTS[command]
        numbers = [float(x) for x in tokens[i + 1 : i + 1 + 2 * count]]
        points = [
            (round(across * x), round(100 * y)) for x, y in zip(numbers[::2], numbers[1::2], strict=True)
        ]
        i += 1 + 2 * count
        if command == "M":
            out.append(f"M{_pair(points[0], across)}")
            at = start = points[0]
            last = "M"
            continue
        steps = [(x - at[0], y - at[1]) for x, y in points]
        text = ""
        for step in steps:
            pair = _pair(step, across)
            text += pair if not text or pair[0] == "-" else f" {pair}"
        lower = command.lower()
        joint = lower if last != lower else "" if text[0] == "-" else " "
        out.append(joint + text)
        at, last = points[-1], lower
    return "".join(out)


def _pair(point: tuple[int, int], across: int) -> str:
    x, y = _short(point[0] / across, 3), _short(point[1] / 100)
    return x + y if y[0] == "-" else f"{x} {y}"


def _short(value: float, decimals: int = 2) -> str:
    """Return a number as short as path data allow."""
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".") if decimals else f"{value:.0f}"
    if text in ("-0", ""):
        return "0"
    return text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text


def _write(element: ElementTree.Element) -> str:
    """Return an element as text, every value escaped."""
    attributes = "".join(f' {name}="{escape(value)}"' for name, value in element.attrib.items())
    inner = "".join(_write(child) + str(escape((child.tail or "").strip())) for child in element)
    text = element.text or ""
    text = str(escape(text)) if element.tag in ("text", "tspan", "title") else ""
    content = text + inner
    return (
        f"<{element.tag}{attributes}>{content}</{element.tag}>"
        if content
        else f"<{element.tag}{attributes}/>"
    )

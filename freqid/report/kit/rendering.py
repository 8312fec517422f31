"""Templates in, texts out: pages for the browser with every value escaped, plain text as it is."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from freqid.core.store import replacing

_FOLDER = Path(__file__).parents[1] / "templates"
_TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(_FOLDER),
    autoescape=lambda name: not (name or "").endswith(".txt"),
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    undefined=jinja2.StrictUndefined,
)

_SCRIPT = (_FOLDER / "page.js").read_text(encoding="utf-8")
# The browser runs no other script in the page, whatever a name in a file may hold.
# jinja2 says of its globals no more than what they are at first.
_TEMPLATES.globals |= {  # pyrefly: ignore[bad-assignment]
    "script": Markup(_SCRIPT),
    "script_hash": "sha256-" + base64.b64encode(hashlib.sha256(f"\n{_SCRIPT}\n".encode()).digest()).decode(),
}


class Sheet(str):
    """The text of a page, which can also be had as a part of another page."""

    template: str
    values: dict[str, Any]
    after: Markup = Markup("")
    """What stands after the last section where the page is a part of another."""

    def part(self, prefix: str) -> Part:
        """Return the contents as a part of a page, every id and link inside it beginning with a prefix.

        Parameters
        ----------
        prefix : str
            Letters, digits and hyphens; unique in the page.
        """
        text = _TEMPLATES.get_template(self.template).render(layout="part.html", **self.values)
        text = _IDS.sub(rf"\g<1>{prefix}-", text)
        text = _HEADS.sub(lambda head: f"{head[1]}{int(head[2]) + _DEEPER}", text)
        style, contents, body = text.split(_CUT)
        return Part(Markup(style.strip()), Markup(contents), Markup(body) + self.after)


@dataclass(frozen=True)
class Part:
    """What a page takes in of another: rules of style, entries of its contents, and the sections.

    Attributes
    ----------
    style, contents, body : Markup
    """

    style: Markup
    contents: Markup
    body: Markup


# Values are escaped, so no text of a file holds one of these. Methods and open risks stand once in
# a report, outside parts.
_IDS = re.compile(
    r"""(\s(?:id|aria-labelledby|aria-describedby|for)="|href="#|url\(#)(?=[^"])(?!method-|risks")"""
)
_HEADS = re.compile(r"(</?h)([1-4])(?=[\s>])")
_DEEPER = 2  # levels that a part's headings are below those of a page of its own
_CUT = "<!--cut-->"


def render(template: str, **values: Any) -> Sheet:
    """Return a template of the folder beside this file with its values filled in.

    Parameters
    ----------
    template : str
        File name; one that ends in ``.txt`` gives plain text, any other HTML.
    **values
        What the template names. One that is missing is a bug, not an empty place.
    """
    values = without_folders(values)
    sheet = Sheet(_TEMPLATES.get_template(template).render(layout="page.html", **values))
    sheet.template, sheet.values = template, values
    return sheet


def without_folders(value: Any) -> Any:
    """Return what a page shows with absolute paths cut down to names: they say whose machine it was."""
    if isinstance(value, Mapping):
        return {without_folders(key): without_folders(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [without_folders(inner) for inner in value]
    if isinstance(value, Markup):
        return Markup(_FOLDERS.sub("", value))
    if isinstance(value, str):
        return _FOLDERS.sub("", value)
    if is_dataclass(value) and not isinstance(value, type):
        texts = {f.name: getattr(value, f.name) for f in fields(value)}
        return replace(value, **{n: without_folders(v) for n, v in texts.items() if isinstance(v, str)})
    return value


# Not inside a tag or an address; a path that begins in a folder named before it is not absolute.
_FOLDERS = re.compile(
    r"""(?<![\w./~:<>)\]])(?:(?:[A-Za-z]:)?(?:/[^/\s:<>"]+)+/(?=[^/\s<>"])|[A-Za-z]:\\(?:[^\\\s<>"]+\\)+)"""
)


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8, whole or not at all.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")

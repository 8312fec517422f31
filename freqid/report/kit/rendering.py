"""Templates in, texts out: pages for the browser with every value escaped, plain text as it is."""

from __future__ import annotations

import base64
import hashlib
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import jinja2
from markupsafe import Markup

from freqid.core.store import replacing


def without_folders(value: Any) -> Any:
    """Return a file's name in place of its absolute path: a page says nothing of the machine it was made on.

    Parameters
    ----------
    value : Any
        What a template writes. A text that is no absolute path, and anything else, is returned as it is.
    """
    if isinstance(value, str) and not isinstance(value, Markup):
        for kind in (PurePosixPath, PureWindowsPath):
            if kind(value).is_absolute() and kind(value).name:
                return kind(value).name
    return value


_FOLDER = Path(__file__).parents[1] / "templates"
_TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(_FOLDER),
    autoescape=lambda name: not (name or "").endswith(".txt"),
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    undefined=jinja2.StrictUndefined,
    finalize=without_folders,
)

_SCRIPT = (_FOLDER / "page.js").read_text(encoding="utf-8")
# The browser runs no other script in the page, whatever a name in a file may hold.
_TEMPLATES.globals |= {
    "script": Markup(_SCRIPT),
    "script_hash": "sha256-" + base64.b64encode(hashlib.sha256(f"\n{_SCRIPT}\n".encode()).digest()).decode(),
}
_TEMPLATES.filters["without_folders"] = without_folders


def render(template: str, **values: Any) -> str:
    """Return a template of the folder beside this file with its values filled in.

    Parameters
    ----------
    template : str
        File name; one that ends in ``.txt`` gives plain text, any other HTML.
    **values
        What the template names. One that is missing is a bug, not an empty place.
    """
    return _TEMPLATES.get_template(template).render(**values)


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8, whole or not at all.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")

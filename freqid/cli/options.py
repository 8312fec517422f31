"""What the commands' options have in common."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])


def output(default: str) -> Callable[[Command], Command]:
    """Return the ``-o`` option; `default` says in words where the result goes without it."""
    return click.option(
        "-o", "--output", "destination", type=click.Path(path_type=Path), help=f"Result; default: {default}."
    )


def keep_inputs(destination: Path, *inputs: Path | None) -> None:
    """Refuse a result that would replace one of the files it is made from.

    Raises
    ------
    UsageError
    """
    from freqid.core.errors import UsageError

    for source in inputs:
        if source is not None and source.exists() and destination.exists() and destination.samefile(source):
            raise UsageError(f"the result would replace its own input {source}", remedy="change -o")


def as_json(command: Command) -> Command:
    """Add ``--json``."""
    return click.option("--json", "json_", is_flag=True, help="Print the result as JSON.")(command)


def emit(json_: bool, result: dict[str, Any], text: str) -> None:
    """Print a result to stdout, for machines or for people."""
    click.echo(json.dumps(result, indent=2, allow_nan=False) if json_ else text)

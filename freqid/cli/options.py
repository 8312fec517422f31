"""What the commands' options have in common."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click

from freqid.core.sections.estimators import ESTIMATOR_NAMES

Command = TypeVar("Command", bound=Callable[..., Any])
FILE = click.Path(path_type=Path)
_GIVEN = (click.core.ParameterSource.COMMANDLINE, click.core.ParameterSource.ENVIRONMENT)


class _Jobs(click.IntRange):
    """Processes at once; none is no number of them."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, from -1 up and not 0."""
        found = super().convert(value, param, ctx)
        if found == 0:
            self.fail("0 processes do nothing; give 1 or more, or -1 for one a core.", param, ctx)
        return found


def jobs(command: Command) -> Command:
    """Add ``--jobs``."""
    meaning = "Processes at once; -1 for one a core."
    return click.option("--jobs", type=_Jobs(min=-1), default=2, show_default=True, help=meaning)(command)


def seed(meaning: str | None = None) -> Callable[[Command], Command]:
    """Return the ``--seed`` option; `meaning` is its help."""
    return click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help=meaning)


def output(default: str) -> Callable[[Command], Command]:
    """Return the ``-o`` option; `default` says in words where the result goes without it."""
    return click.option("-o", "--output", "destination", type=FILE, help=f"Result; default: {default}.")


def simulation(scenario: str, *, several: bool = False) -> Callable[[Command], Command]:
    """Return ``--sim``, ``--predictions`` and ``--scenario``; `scenario` is the last one's help.

    With `several` the first may be repeated.
    """

    def add(command: Command) -> Command:
        command = click.option("--scenario", type=FILE, help=scenario)(command)
        command = click.option(
            "--predictions",
            multiple=True,
            type=FILE,
            help="Recorded predictions in place of a simulation; may be repeated.",
        )(command)
        kinds = "FILE.py:NAME, MODEL.fmu, jsbsim:AIRCRAFT, SCENARIO.toml or predictions FILE.h5."
        meaning = f"{kinds} Two are compared with each other." if several else kinds
        meaning += " Code in a .py or .fmu file is run, with all your rights."
        return click.option("--sim", multiple=several, help=meaning)(command)

    return add


def refuse_beside(what: str, *parameters: str) -> None:
    """Refuse options of the running command that do nothing beside `what`, where they are given.

    Raises
    ------
    UsageError
    """
    from freqid.core.errors import UsageError

    context = click.get_current_context()
    for option in context.command.params:
        if option.name in parameters and context.get_parameter_source(option.name) in _GIVEN:
            raise UsageError(f"{option.opts[0]} does nothing beside {what}", remedy="drop one of the two")


def own_effects(command: Command) -> Command:
    """Return ``--effects``."""
    meaning = "Python file with effects of your own. Its code is run, with all your rights."
    return click.option("--effects", "own_effects", type=FILE, help=meaning)(command)


def parsed(read: Callable[[str], Any]) -> Callable[[click.Context, click.Parameter, Any], Any]:
    """Return a callback that reads the text of an option, each of several by itself; None stays None."""

    def callback(_: click.Context, __: click.Parameter, given: Any) -> Any:
        if isinstance(given, tuple):
            return tuple(read(text) for text in given)
        return None if given is None else read(given)

    return callback


def band(absent: str) -> Callable[[Command], Command]:
    """Return ``--band``, in Hz as ``band_hz``; `absent` says in words what holds without it."""
    return click.option("--band", "band_hz", callback=parsed(_band), help=f"LOW:HIGH, Hz; {absent}.")


def _band(text: str) -> tuple[float, float]:
    """Return two positive numbers, the lower one first."""
    from freqid.core.errors import UsageError

    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        low = high = 0.0
    if not 0 < low < high < float("inf"):
        raise UsageError(f"--band is LOW:HIGH in Hz such as 0.1:2, not '{text}'")
    return low, high


def page_option(drawing: str) -> Callable[[Command], Command]:
    """Return ``--page/--no-page``; `drawing` says in words what the page shows."""
    return click.option(
        "--page/--no-page", default=True, help=f"Draw {drawing}, in an HTML page beside the result."
    )


def estimator(command: Command) -> Command:
    """Add ``--estimator``."""
    return click.option(
        "--estimator",
        type=click.Choice(ESTIMATOR_NAMES),
        help="In place of the scenario's. Instruments are not biased by noise in the regressors; they need "
        "the injected signals.",
    )(command)


def choices(known: dict[str, list[str]], meaning: str) -> Callable[[Command], Command]:
    """Return options that each take one of some words; `meaning` is the help of all of them."""

    def add(command: Command) -> Command:
        for name, words in reversed(known.items()):
            command = click.option(name, type=click.Choice(words), help=meaning)(command)
        return command

    return add


def names(text: str) -> tuple[str, ...]:
    """Return names that stand with commas between them."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def span(text: str) -> tuple[float, float]:
    """Return start and stop, s, of ``START:STOP``."""
    from freqid.core.record import parse_span

    return parse_span(text)


def keep_inputs(result: Path | Iterable[Path | None], *inputs: Path | None) -> None:
    """Refuse a result, or several, that would replace one of the files it is made from.

    Raises
    ------
    UsageError
    """
    from freqid.core.errors import UsageError

    for one in [result] if isinstance(result, Path) else result:
        for source in inputs:
            if one and source and source.exists() and one.exists() and one.samefile(source):
                raise UsageError(f"the result would replace its own input {source}", remedy="change -o")


def page_beside(result: Path, page: bool, *inputs: Path | None) -> Path | None:
    """Return where the page of a result goes, None without one; neither replaces an input, or the other.

    Raises
    ------
    UsageError
    """
    from freqid.core.errors import UsageError

    drawn = result.with_suffix(".html") if page else None
    if drawn == result:
        raise UsageError(
            "the result is no page; the page is written beside it",
            where=str(result),
            remedy=f"write -o {result.with_suffix('.h5')}",
        )
    keep_inputs((result, drawn), *inputs)
    return drawn


def written(*files: Path | None) -> str:
    """Return the files that were written, a line each."""
    return "\n".join(str(file) for file in files if file)


def as_json(command: Command) -> Command:
    """Add ``--json``."""
    return click.option("--json", "json_", is_flag=True, help="Print the result as JSON.")(command)


def emit(json_: bool, result: dict[str, Any], text: str) -> None:
    """Print a result to stdout, for machines or for people."""
    click.echo(json.dumps(result, indent=2, allow_nan=False) if json_ else text)


def sigma(option: str, example: str) -> Callable[[str], tuple[str, float]]:
    """Return a reader of ``NAME=SIGMA`` for an option; `example` is one that it takes."""

    def read(word: str) -> tuple[str, float]:
        from freqid.core.errors import UsageError

        name, _, value = word.partition("=")
        try:
            return name.strip(), float(value)
        except ValueError:
            raise UsageError(f"{option} is NAME=SIGMA such as {example}, not '{word}'") from None

    return read

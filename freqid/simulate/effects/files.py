"""Effects from a file of the user's own."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

from freqid.core.errors import UsageError
from freqid.simulate.effects import shipped
from freqid.simulate.effects.effect import Effect, Parameter, Stage

# What every hook is called with; the stages that a hook is asked in, all where none are named.
_ARGUMENTS = {
    "add": ("settings", "situation"),
    "start": ("settings", "situation"),
    "rate": ("settings", "situation"),
    "replay": ("settings", "replay"),
    "act": ("settings", "signals", "dt", "kinds"),
    "feel": ("settings", "signals", "dt", "kinds"),
    "distort": ("settings", "record"),
    "load": ("settings", "vehicle"),
    "for_vehicle": ("vehicle",),
}


def load_file(path: Path) -> dict[str, Effect]:
    """Return the effects of a Python file, by id; `effects.register` makes one part of the library.

    The file is run as a module of its own, under no name that anything else could import. It holds one
    effect as ``EFFECT``, or several as ``EFFECTS``, a list. Its code may do whatever you may do: read it
    before you run somebody else's.

    Raises
    ------
    UsageError
        Where the file is missing, raises, holds no effect, or an effect has the id of one that comes with
        freqid, no parameter, an unknown stage or a hook that cannot be called as it will be.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"the file of effects cannot be read ({error})", where=str(path)) from None
    module = ModuleType(f"effects of {path.name}")
    module.__file__ = str(path)
    try:
        exec(compile(text, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        raise UsageError(
            f"running the file raises {type(error).__name__}: {error}{_line(error, path)}",
            where=str(path),
            remedy="correct the file",
        ) from error
    names: Mapping[str, Any] = vars(module)
    held = names.get("EFFECTS", [names["EFFECT"]] if "EFFECT" in names else [])
    effects = list(held.values()) if isinstance(held, dict) else list(held)
    if not effects:
        raise UsageError(
            "the file holds no effect",
            where=str(path),
            remedy="name an Effect EFFECT, or a list of them EFFECTS",
        )
    found: dict[str, Effect] = {}
    for effect in effects:
        fault = _fault(effect, found)
        if fault:
            raise UsageError(fault, where=str(path))
        found[effect.id] = effect
    return found


def _fault(effect: Any, before: Mapping[str, Effect]) -> str:
    """Return what is wrong with an effect, nothing where it can be used."""
    if not isinstance(effect, Effect):
        return (
            f"found an effect of type {type(effect).__name__}, expected freqid.simulate.effects.effect.Effect"
        )
    name = f"effect '{effect.id}'"
    if effect.id in shipped():
        return f"{name} has the id of one that comes with freqid; give it another id"
    if effect.id in before:
        return f"{name} is there twice; give one of them another id"
    # a file of one's own may hold anything
    if not str(effect.id).isidentifier():  # pyrefly: ignore[unnecessary-type-conversion]
        return f"{name} has an id that is no Python name, expected one such as icing"
    if effect.stage not in get_args(Stage):
        return f"{name} has the stage '{effect.stage}', expected one of {', '.join(get_args(Stage))}"
    if not effect.parameters or not all(isinstance(p, Parameter) for p in effect.parameters.values()):
        return f"{name} has no parameters, expected a dict of Parameter with the effect's size first"
    if all(getattr(effect, hook) is None for hook in ("add", "replay", "act", "feel", "distort", "load")):
        return f"{name} does nothing, expected one of the hooks add, replay, act, feel, distort, load"
    if effect.rate is not None and effect.start is None:
        return f"{name} has a rate but no start of its memory, expected both"
    for hook, arguments in _ARGUMENTS.items():
        function = getattr(effect, hook)
        if function is not None and not _takes(function, len(arguments)):
            return f"{name}: {hook} cannot be called as {hook}({', '.join(arguments)})"
    return ""


def _takes(function: Any, count: int) -> bool:
    try:
        inspect.signature(function).bind(*range(count))
    except (TypeError, ValueError):
        return False
    return True


def _line(error: BaseException, path: Path) -> str:
    """Return where in the file an error was raised."""
    at = error.__traceback__
    lines = []
    while at is not None:
        if at.tb_frame.f_code.co_filename == str(path):
            lines.append(at.tb_lineno)
        at = at.tb_next
    return f", line {lines[-1]}" if lines else ""

"""Libraries that are installed only where they are wanted."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from freqid.core.errors import DataError


def extra(module: str, name: str, where: str | None = None) -> ModuleType:
    """Import a module of an optional extra.

    Parameters
    ----------
    module : str
        To be imported.
    name : str
        Of the extra that has it.
    where : str, optional
        The file that needs it.

    Raises
    ------
    DataError
        Where it is not installed; the sentence names the command that installs it.
    """
    try:
        return import_module(module)
    except ImportError:
        raise DataError(
            f"needs {module.partition('.')[0]}, which is not installed"
            if where
            else f"this needs {module.partition('.')[0]}, which is not installed",
            where=where,
            remedy=f"install it with: pip install 'freqid[{name}]'",
        ) from None

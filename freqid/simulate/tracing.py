"""Functions for JAX whose traced form is stored, so that a fresh process does not trace them again.

JAX keeps compiled code between processes, but to find it, it traces the Python code and lowers it to
StableHLO, which takes several times as long as reading the compiled code. Here that form is stored too, by
`jax.export`, in a file for each function, version of the code and structure of the arguments.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import sys
from collections.abc import Callable, Sequence
from functools import cache, wraps
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import jax

import freqid
from freqid.core import store
from freqid.dynamics import precision
from freqid.simulate.effects import library, shipped

T = TypeVar("T")

_FOLDER = precision.CACHE.with_name("traces")
_CODE = ("core", "dynamics", "simulate")  # all that is traced stands in these folders of the package
_SUM = 64  # hexadecimal digits that a file begins with: SHA-256 of what follows


def stored(function: Callable[..., T]) -> Callable[..., T]:
    """Compile a function with `jax.jit`; its traced form is stored for other processes.

    The result is the same whether a file was there or not: the stored form is what is compiled in both cases.
    A file that is damaged or cannot be read or written is as good as none. With users' own effects, whose
    code may change, nothing is stored.

    Parameters
    ----------
    function : callable
        Of trees of arrays, to a tree of arrays in dicts, tuples and named tuples. All code that it depends on
        is freqid's.

    Returns
    -------
    callable
        Neither `jax.vmap` nor differentiation can be applied to it: apply them to `function`.
    """

    @jax.jit
    @wraps(function)
    def traced(*arguments):
        if library() != shipped():
            return function(*arguments)
        leaves, structure = jax.tree.flatten(arguments)
        path = _FOLDER / _key(function, structure, leaves)
        try:
            form = _read(path) or _made(path, function, structure, leaves)
            return _called(form, leaves)
        except Exception:  # another release of JAX may refuse to export or to read what it exported
            return function(*arguments)

    return traced


def _called(form: bytes, leaves: Sequence[jax.Array]) -> Any:
    """Return the outputs of a stored form."""
    from jax import export

    head, _, module = form.partition(b"\n")
    outputs: Any = export.deserialize(bytearray(module)).call(*leaves)
    return _assembled(json.loads(head), outputs)


def _made(path: Path, function: Callable[..., Any], structure: Any, leaves: Sequence[jax.Array]) -> bytes:
    """Trace a function and store the form: a line of JSON, how its outputs are nested, and the module."""
    from jax import export

    nested: list[Any] = []

    @jax.jit
    def flat(*leaves):
        outputs, tree = jax.tree.flatten(function(*jax.tree.unflatten(structure, leaves)))
        nested[:] = [_nesting(jax.tree.unflatten(tree, range(len(outputs))))]
        return outputs

    module = export.export(flat)(*(jax.ShapeDtypeStruct(x.shape, x.dtype) for x in leaves)).serialize()
    form = json.dumps(nested[0]).encode() + b"\n" + bytes(module)
    try:
        with store.replacing(path) as temporary:
            temporary.write_bytes(hashlib.sha256(form).hexdigest().encode() + form)
    except store.DataError:
        pass  # the folder cannot be written
    return form


def _read(path: Path) -> bytes | None:
    """Return a stored form, None where there is none that is whole."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    form = content[_SUM:]
    return form if hashlib.sha256(form).hexdigest().encode() == content[:_SUM] else None


def _key(function: Callable[..., Any], structure: Any, leaves: Sequence[jax.Array]) -> str:
    """Return the name of a function's file: whatever its traced form depends on is in it."""
    shapes = [f"{x.dtype}{list(x.shape)}" for x in leaves]
    told = "\n".join([_release(), f"{function.__module__}.{function.__qualname__}", str(structure), *shapes])
    return f"{function.__name__.strip('_')}-{hashlib.sha256(told.encode()).hexdigest()[:32]}"


@cache
def _release() -> str:
    """Return what identifies freqid's code, JAX and how it is set."""
    package = Path(freqid.__file__).parent
    code = hashlib.sha256()
    for path in sorted(p for folder in _CODE for p in (package / folder).rglob("*.py")):
        content = path.read_bytes()
        code.update(f"{path.relative_to(package)} {len(content)}\n".encode() + content)
    settings = (jax.default_backend(), jax.config.read("jax_enable_x64"), sys.version_info[:2])
    return f"{version('jax')} {version('jaxlib')} {settings} {code.hexdigest()}"


def _nesting(tree: Any) -> Any:
    """Return a tree whose leaves are whole numbers as JSON."""
    if isinstance(tree, tuple | list):
        kind = type(tree)
        return {"of": [kind.__module__, kind.__qualname__], "in": [_nesting(x) for x in tree]}
    if isinstance(tree, dict):
        return {"dict": {name: _nesting(x) for name, x in tree.items()}}
    return tree


def _assembled(nested: Any, leaves: Sequence[Any]) -> Any:
    """Return the tree that `_nesting` described, with its leaves."""
    if not isinstance(nested, dict):
        return None if nested is None else leaves[nested]
    if "dict" in nested:
        return {name: _assembled(x, leaves) for name, x in nested["dict"].items()}
    module, name = nested["of"]
    parts = [_assembled(x, leaves) for x in nested["in"]]
    kind = getattr(importlib.import_module(module), name)
    return kind(*parts) if hasattr(kind, "_fields") else kind(parts)

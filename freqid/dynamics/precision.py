"""JAX as the simulation needs it: 64-bit, on the processor, compiled for small loops, code kept between runs.

Every module of the simulation that uses JAX imports this one first.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

# A flight is one loop over a few thousand small array operations a step. By default each operation is
# dispatched on its own, which costs several times its arithmetic. These flags compile the whole loop into
# one function, with small products left inside it.
_FLAGS = (
    "--xla_cpu_experimental_ynn_fusion_type=",
    # The threshold counts bytes over all turns of a loop: 1e15 takes every flight for small. Fusing several
    # outputs (xla_cpu_use_multi_output_fusion) makes flights slower: 40 k steps/s in place of 57 k.
    "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1000000000000000",
)
# An unknown flag ends the process, so they are given only to the releases that they were tried with,
# and flags of the user's own stand.
if version("jaxlib").startswith("0.10.") and "XLA_FLAGS" not in os.environ:
    os.environ["XLA_FLAGS"] = " ".join(_FLAGS)

import jax  # noqa: E402  the flags must come first

# Trim residuals of 1e-8 of the weight and momentum kept to 1e-8 over a minute need doubles.
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_platforms", "cpu")

# A flight's scan takes seconds to compile; a fresh process reads it back instead.
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "freqid" / "jax"
jax.config.update("jax_compilation_cache_dir", str(CACHE))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def doubles(kind: Callable[..., T], *values: Any, **fields: Any) -> T:
    """Return a named tuple whose leaves are all numpy's arrays of doubles; a list is one of them.

    Nothing is compiled for these, as it is for every shape of an array that JAX makes.
    """
    return jax.tree.map(
        lambda leaf: np.asarray(leaf, dtype=float),
        kind(*values, **fields),
        is_leaf=lambda x: isinstance(x, list),
    )

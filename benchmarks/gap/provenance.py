"""Which state of the program made a case."""

from __future__ import annotations

import subprocess
from pathlib import Path

import freqid

_TREES = {Path(__file__).resolve().parents[2], Path(freqid.__file__).resolve().parents[1]}
# results that lie beside what makes them are no part of the program
_SOURCES = ("freqid", "benchmarks/gap", *(f":(exclude)benchmarks/gap/*.{e}" for e in ("csv", "tar.xz")))


def code() -> str:
    """Return the commit of the program, with ``-dirty`` where its sources differ from that.

    Commits of both where these scripts and the package are not of one tree; ``unknown`` without git.
    """
    return "+".join(sorted({_commit(tree) for tree in _TREES}))


def _commit(tree: Path) -> str:
    commit = _git(tree, "rev-parse", "--short=10", "HEAD")
    if not commit:
        return "unknown"
    return commit + ("-dirty" if _git(tree, "status", "--porcelain", "--", *_SOURCES) else "")


def _git(tree: Path, *words: str) -> str:
    try:
        told = subprocess.run(["git", *words], cwd=tree, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return told.stdout.strip()

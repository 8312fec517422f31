"""Moments about another reference point, ``M_B = M_A + (A - B) x F``, of numpy and jax arrays alike."""

from __future__ import annotations

from typing import Any, TypeVar

from freqid.dynamics.frames import cross

Vector = TypeVar("Vector")


def moment_about(arm: Any, force: Vector, moment: Any = None, *, axis: int = 0) -> Vector:
    """Return the moment of a load about another reference point than the one it is given at.

    Parameters
    ----------
    arm : array
        From the new reference point to the one that the load is given at, m. A load that is given at the
        origin is brought to a point by minus the place of that point.
    force : array
        N.
    moment : array, optional
        About the point that the load is given at, N m; zero where absent.
    axis : {0, -1}
        Along which the components are: 0 for shape (3, ...), as in records, -1 for (..., 3), as in the
        simulation. The other axes broadcast.

    Returns
    -------
    array
        N m. Of numpy where all are of numpy, else of jax, which may trace it.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., chapter 3.
    """
    arisen = cross(arm, force, axis=axis)
    return arisen if moment is None else moment + arisen

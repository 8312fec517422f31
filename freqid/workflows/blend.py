"""Point models along the corridor become one global model."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.core.results.point import PointModel
from freqid.workflows.inputs import File, point_of, several


def blend(
    points: PointModel | File | Iterable[PointModel | File],
    *,
    densities: Literal["apart", "together"] = "apart",
) -> GlobalModel:
    """Blend point models into one model over the transition corridor.

    Parameters
    ----------
    points : PointModel or path, several
        Of one aircraft, at two conditions or more.
    densities : {"apart", "together"}
        A line for each air density, or all points on one line in equivalent speed.

    Returns
    -------
    GlobalModel
        ``model.wrench(u=30.0, de1=0.05)`` gives the responses there, N and N m (or as the points' form has
        it), with standard errors; what is not given is at the corridor's own trim.

    Raises
    ------
    UsageError
        Where points do not fit each other, or there are too few.
    DataError
        Where a file is no intact point model.

    Notes
    -----
    Shape-preserving cubics of equivalent speed on every line, linear in density between lines
    (docs/theory/global-model.md).

    Examples
    --------
    >>> aircraft = blend(["points/u20.h5", "points/u45.h5"])  # doctest: +SKIP
    >>> aircraft.wrench(u=10.0, de1=0.05)  # doctest: +SKIP
    """
    given = several(points)
    read = [point_of(one) for one in given]
    names = [
        str(g) if isinstance(g, str | Path) else r.reference.id for g, r in zip(given, read, strict=True)
    ]
    return GlobalModel(line_up(read, names, densities))

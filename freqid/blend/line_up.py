"""Point models to a corridor: what must agree between them, and which line each belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from freqid.blend.line import turns
from freqid.blend.similarity import ALIKE, equivalent, not_similar
from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.results.corridor import Corridor, KnotResponse
from freqid.core.results.point import PointModel
from freqid.core.sections.identification import factors_of

Densities = Literal["apart", "together"]

SAME_SPEED = 0.05  # m/s: two points closer than this are one condition
SAME_TILT = np.deg2rad(1.0)  # what a tilt may go back by along a corridor: how well a wing is set
_DISTINCT = 1e-3  # of its range: how far apart a scheduled variable must set neighbours that lie along it


def line_up(
    points: Sequence[PointModel], files: Sequence[str], densities: Densities = "apart", along: str = ""
) -> Corridor:
    """Line point models up along the transition corridor.

    Parameters
    ----------
    points : sequence of PointModel
        Two or more, in any order.
    files : sequence of str
        Where each comes from, for errors and provenance.
    densities : {"apart", "together"}
        Whether points of each density make a line of their own, or all make one line in equivalent
        speed ``u sqrt(rho / RHO0)``. Together is right where tilt is scheduled by equivalent speed.
    along : str
        What the lines run along: ``u``, or a variable that the references set. Where empty, speed, or if
        all points have the same, the first scheduled variable that varies.

    Returns
    -------
    Corridor

    Raises
    ------
    UsageError
        For fewer than two points.
    DataError
        Where points differ in aircraft, form or regressors, repeat a condition, or lie on no one line.
    """
    if len(points) < 2:
        raise UsageError(
            f"a global model needs two point models or more, found {len(points)}",
            remedy="name the files of several conditions",
        )
    for point, file in zip(points, files, strict=True):
        _check_alone(point, file)
        _check_compatible(points[0], files[0], point, file)
    rho = np.array([p.reference.rho for p in points])
    level = density_levels(rho)
    _check_density_laws(points[0], rho, files)
    line = level if densities == "apart" else np.zeros_like(level)
    speed = np.array([p.reference.u for p in points]) * equivalent(rho)
    names = _scheduled(points)
    schedule = np.array([[p.reference.scheduled.get(n, 0.0) for p in points] for n in names])
    schedule = schedule.reshape(len(names), len(points))
    along = along or _sets_apart(speed, names, schedule)
    if along not in ("u", *names):
        raise UsageError(
            f"the points set no '{along}' for the corridor to run along", remedy=nearest(along, ("u", *names))
        )
    place = speed if along == "u" else schedule[names.index(along)]
    order = np.lexsort((place, line))
    points, files = [points[int(i)] for i in order], [files[int(i)] for i in order]
    line, place, schedule = line[order], place[order], schedule[:, order]
    stated = {n: unit for p in points for n, unit in p.scheduled_units.items()}
    corridor = Corridor(
        ids=tuple(p.reference.id for p in points),
        u=np.array([p.reference.u for p in points]),
        rho=np.array([p.reference.rho for p in points]),
        schedule=schedule,
        line=line,
        responses={name: _knots(name, points) for name in points[0].responses},
        form=points[0].form,
        vehicle=points[0].vehicle,
        highest_hz=_highest(points),
        provenance={
            "files": list(files),  # in the order of the knots, which the mapping loses in a file
            "points": dict(zip(files, (p.provenance for p in points), strict=True)),
        },
        scheduled=names,
        scheduled_units=tuple(stated.get(n, "rad") for n in names),
        along=along,
        aircraft=points[0].aircraft if all(p.aircraft == points[0].aircraft for p in points) else None,
    )
    for i in range(line.max() + 1):
        _check_line(corridor, np.flatnonzero(line == i), points, files)
    return corridor


def _scheduled(points: Sequence[PointModel]) -> tuple[str, ...]:
    """Return what any of the points sets beside speed and density, in their order."""
    return tuple(dict.fromkeys(name for p in points for name in p.reference.scheduled))


def _sets_apart(speed: Array, names: Sequence[str], schedule: Array) -> str:
    """Return what a corridor runs along: speed, or the first variable that varies where speed does not."""
    if np.ptp(speed) >= SAME_SPEED:
        return "u"
    return next((n for n, row in zip(names, schedule, strict=True) if np.ptp(row) > 0), "u")


def _check_alone(point: PointModel, file: str) -> None:
    at = point.reference
    for name, value in {"u": at.u, "rho": at.rho, **at.scheduled}.items():
        if not np.isfinite(value) or (name == "rho" and not value > 0):
            raise DataError(
                f"reference '{at.id}' has {name} = {value:g}, so it has no place on the corridor",
                where=file,
                remedy="identify the point again with --at and a reference that states it",
            )
    if point.axes != "body":
        raise DataError(
            f"is a model in {point.axes} axes, which turn from point to point; expected body axes",
            where=file,
            remedy="identify it again with --axes body",
        )
    products = [n for r in point.responses.values() for n in r.regressors if len(factors_of(n)) > 1]
    if products:
        raise DataError(
            f"has the product '{products[0]}' among its regressors, which a global model does not blend",
            where=file,
            remedy="identify it again with --nonlinear none",
        )
    for response in point.responses.values():
        if not (np.isfinite(response.covariance).all() and np.isfinite(response.estimate).all()):
            raise DataError(f"response '{response.response}' holds numbers that are not finite", where=file)


def _check_compatible(first: PointModel, first_file: str, point: PointModel, file: str) -> None:
    """Refuse points that are not the same function of the same variables of the same aircraft."""

    def differ(what: str, found: Any, expected: Any) -> DataError:
        return DataError(
            f"{what} {found}, expected {expected} as in {first_file}",
            where=file,
            remedy="identify all points of a corridor alike",
        )

    for what in ("vehicle", "form"):
        found, expected = getattr(point, what), getattr(first, what)
        if found != expected:
            raise differ(f"has the {what}", f"'{found}'", f"'{expected}'")
    if set(point.responses) != set(first.responses):
        raise differ("has responses", " ".join(point.responses), " ".join(first.responses))
    for name, response in point.responses.items():
        if response.unit != first[name].unit:
            raise differ(f"has '{name}' in", response.unit, first[name].unit)
        found, expected = (
            sorted(f"{x} [{unit}]" for x, unit in zip(r.regressors, r.regressor_units, strict=True))
            for r in (response, first[name])
        )
        if found != expected:
            extra, lacking = (sorted(set(a) - set(b)) for a, b in ((found, expected), (expected, found)))
            raise differ(
                f"has regressors of '{name}'",
                f"with {', '.join(extra) or 'nothing more'} and without {', '.join(lacking) or 'nothing'}",
                "the same",
            )


def density_levels(rho: Array) -> NDArray[np.int64]:
    """Return the level of each density, from 0: a level ends where the next density is 2 % higher."""
    order = np.argsort(rho)
    rises = rho[order][1:] > (1 + ALIKE) * rho[order][:-1]
    level = np.empty(rho.size, dtype=np.int64)
    level[order] = np.concatenate([[0], np.cumsum(rises)])
    return level


def _check_density_laws(point: PointModel, rho: Array, files: Sequence[str]) -> None:
    """Refuse several densities where a regressor has no law that carries it from one to another."""
    if np.ptp(rho) <= ALIKE * rho.max():
        return
    for response in point.responses.values():
        names = not_similar(dict(zip(response.regressors, response.regressor_units, strict=True)))
        if names:
            raise DataError(
                f"is at {rho.min():.4g} kg/m3 and {files[int(rho.argmax())]} at {rho.max():.4g}, but no law "
                f"carries regressor '{names[0]}' from one density to another",
                where=files[int(rho.argmin())],
                remedy="blend points of one density, or regress on rotor speed or thrust",
            )


def _check_line(
    corridor: Corridor, members: NDArray[np.int64], points: Sequence[PointModel], files: Sequence[str]
) -> None:
    """Refuse a line of one point, a condition that comes twice, and points that lie on no one line."""
    here = [points[int(k)].reference for k in members]
    named = [files[int(k)] for k in members]
    place, schedule = corridor.coordinate[members], corridor.schedule[:, members]
    by_speed = corridor.along == "u"
    if place.size < 2:
        raise DataError(
            f"is the only point at {here[0].rho:.4g} kg/m3, and one point makes no line",
            where=named[0],
            remedy="add points there, leave it out, or blend with --densities together",
        )
    turned = turns(corridor)[:, None] * schedule
    close = int(np.diff(place).argmin())
    least = SAME_SPEED if by_speed else _DISTINCT * np.ptp(place)
    if place[close + 1] - place[close] < least or not np.ptp(place):
        one, two = here[close], here[close + 1]
        most = np.rad2deg(np.abs(turned[:, close + 1] - turned[:, close]).max(initial=0.0))
        other = next((n for n, row in zip(corridor.scheduled, schedule, strict=True) if _apart(row)), "")
        apart = f" with tilts {most:.3g} deg apart" if most > np.rad2deg(SAME_TILT) else ""
        raise DataError(
            f"reference '{two.id}' (u = {two.u:.4g} m/s, rho = {two.rho:.4g} kg/m3) repeats the "
            f"{'equivalent speed' if by_speed else corridor.along} of '{one.id}' in {named[close]}{apart}",
            where=named[close + 1],
            remedy="keep one of the two" + (f", or blend along {other} (--along {other})" if other else ""),
        )
    for name, unit, row, plain in zip(
        corridor.scheduled, corridor.scheduled_units, turned, schedule, strict=True
    ):
        if _goes_back(row) > SAME_TILT:
            without = [_goes_back(np.delete(row, i)) for i in range(row.size)]
            i = int(np.argmin(without))
            at = here[i]
            raise DataError(
                f"reference '{at.id}' is off the corridor of the other points: at u = {at.u:.4g} m/s its "
                f"{name} of {_shown(plain[i], unit)} makes it go back and forth by "
                f"{_shown(_goes_back(plain), unit, 3)}",
                where=named[i],
                remedy="blend points of one tilt schedule; where densities differ, blend them apart",
            )


def _apart(row: Array) -> bool:
    """Tell whether a scheduled variable sets all points of a line apart."""
    return bool(np.ptp(row) > 0 and np.diff(np.sort(row)).min() >= _DISTINCT * np.ptp(row))


def _shown(value: float, unit: str, digits: int = 4) -> str:
    """Return a value with its unit, angles in degrees."""
    value, unit = (np.rad2deg(value), "deg") if unit == "rad" else (value, unit)
    return f"{value:.{digits}g} {unit}"


def _goes_back(tilt: Array) -> float:
    """Return by how much a tilt goes against its overall sense at worst, rad."""
    rising = tilt if tilt[-1] >= tilt[0] else -tilt
    return float((np.maximum.accumulate(rising) - rising).max())


def _knots(name: str, points: Sequence[PointModel]) -> KnotResponse:
    first = points[0][name]
    models = [p[name] for p in points]
    rows = [[m.regressors.index(n) for n in first.regressors] for m in models]
    columns = [
        np.array([getattr(m, field)[row] for m, row in zip(models, rows, strict=True)]).T
        for field in ("trim", "regressor_rms", "estimate")
    ]
    return KnotResponse(
        response=name,
        unit=first.unit,
        regressors=first.regressors,
        regressor_units=first.regressor_units,
        trim=columns[0],
        regressor_rms=columns[1],
        estimate=columns[2],
        covariance=np.array([m.covariance[np.ix_(row, row)] for m, row in zip(models, rows, strict=True)]),
        bias=np.array([m.bias for m in models]),
        bias_std_error=np.array([m.bias_std_error for m in models]),
    )


def _highest(points: Sequence[PointModel]) -> float:
    fits = [r.fit.get("frequency") for p in points for r in p.responses.values()]
    return float("nan") if None in fits else min(float(f.axis[-1]) for f in fits if f is not None)

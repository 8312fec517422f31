"""A point model from sensors that had to be brought into line first, with what that leaves uncertain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.excitation import Excitation
from freqid.core.identification import Identification
from freqid.core.record import Maneuver
from freqid.core.results.point import PointModel, ResponseModel
from freqid.core.results.point_file import per
from freqid.core.scenario import Reference
from freqid.identify.point import Estimator, identify_point, lines_of
from freqid.identify.regress.uncertainty import independent_share
from freqid.identify.sensors.delays import Alignment, align
from freqid.identify.sensors.delays_loads import Changes

# A parameter is named where an unknown of the alignment adds more than this many of its standard errors.
TOLD = 2.0


def identify_aligned(
    maneuvers: Sequence[Maneuver],
    settings: Identification,
    *,
    excitation: Excitation | None = None,
    reference: Reference | None = None,
    estimator: Estimator | None = None,
) -> tuple[PointModel, tuple[Alignment, ...]]:
    """Align manoeuvres, each by itself, and identify them as `identify_point` does.

    Parameters
    ----------
    maneuvers, settings, excitation, reference, estimator
        As in `identify_point`.

    Returns
    -------
    model : PointModel
        Its standard errors, covariances and intervals hold the uncertainty of the alignment; its remarks name
        the parameters that this more than doubles.
    alignments : tuple of Alignment
        By manoeuvre.

    Raises
    ------
    UsageError
        In the time domain, where there are no lines to align on.
    """
    if settings.method != "frequency":
        raise UsageError(
            f"alignment works on lines, but the method is '{settings.method}'",
            remedy="use the method 'frequency'",
        )
    lines_hz = lines_of(settings, excitation)
    both = [align(m, settings, lines_hz) for m in maneuvers]
    model = identify_point(
        [m for m, _ in both], settings, excitation=excitation, reference=reference, estimator=estimator
    )
    alignments = tuple(a for _, a in both)
    chosen = {name: model[name].regressors for name in settings.responses}
    final = msgspec.structs.replace(settings, regressors=chosen)
    changes = [_changes(a, final, lines_hz) for a in alignments]
    by = {
        name: _sensitivity(changes, model[name], row, by_instruments=model.estimator == "instruments")
        for row, name in enumerate(settings.responses)
    }
    responses = {
        name: _widened(
            model[name],
            np.sum([j.T @ a.covariance @ j for j, a in zip(by[name], alignments, strict=True)], axis=0),
        )
        for name in settings.responses
    }
    remarks = _remarks(model, by, alignments)
    return replace(model, responses=responses, remarks=(*model.remarks, *remarks)), alignments


def _changes(alignment: Alignment, settings: Identification, lines_hz: Array) -> Changes:
    """Return the changes of those regressors that the model has in the end; products may have been added."""
    known = alignment.changes
    if all(n in known.names for r in settings.responses for n in settings.regressors_of(r)):
        return known
    return Changes.about(alignment.flown, alignment.errors, alignment.names, settings, lines_hz)


def _sensitivity(
    changes: Sequence[Changes], response: ResponseModel, row: int, *, by_instruments: bool
) -> list[Array]:
    """Return the derivatives of a response's parameters by the unknowns of each manoeuvre, shape (k, p).

    ``d theta = - (Z^T X)^-1 Z^T (theta dX - dz)``, nuisance columns taken out of all, manoeuvres weighed as
    in the fit.
    """
    parts = []
    for own in changes:
        part, duration = own.part(response.regressors), own.equations.durations[0]
        nuisance = len(part.x) - len(part.columns)
        ends = np.linalg.qr(part.x[:nuisance].T)[0]
        instruments = part.instruments if by_instruments else part.x
        x, z = (rows - (rows @ ends) @ ends.T for rows in (part.x[nuisance:], instruments[nuisance:]))
        weight = independent_share(own.equations.lines_hz, duration) / duration
        parts.append((weight * z, x, part.disturbance(own, row, response.estimate)))
    length = np.sqrt(np.sum([(z**2).sum(axis=1) for z, _, _ in parts], axis=0))[:, None]
    normal = np.sum([(z / length) @ x.T for z, x, _ in parts], axis=0)
    return [-np.linalg.solve(normal, (z / length) @ d.T).T for z, _, d in parts]


def _widened(response: ResponseModel, added: Array) -> ResponseModel:
    """Return a response whose covariance has another part; limits keep their Student factors."""
    covariance = response.covariance + added
    std_error = np.sqrt(np.diag(covariance))
    ratio = std_error / response.std_error
    return replace(
        response,
        covariance=covariance,
        std_error=std_error,
        lower=response.estimate - ratio * (response.estimate - response.lower),
        upper=response.estimate + ratio * (response.upper - response.estimate),
        t_statistic=response.t_statistic / ratio,
        correlation=covariance / np.outer(std_error, std_error),
    )


def _remarks(
    model: PointModel, by: Mapping[str, Sequence[Array]], alignments: Sequence[Alignment]
) -> list[str]:
    """Name, by unknown, the parameters whose standard error it raises more than all noise of the fit does."""
    remarks = []
    for m, alignment in enumerate(alignments):
        for i, (unknown, sigma) in enumerate(zip(alignment.names, alignment.std_error, strict=True)):
            open_ = []
            for name, response in model.responses.items():
                added = np.abs(by[name][m][i]) * sigma
                rows = zip(
                    response.regressors, response.regressor_units, added, response.std_error, strict=True
                )
                open_ += [
                    f"{name} by {n} (+- {2 * a:.2g} {per(response.unit, unit)})"
                    for n, unit, a, s in rows
                    if a > TOLD * s
                ]
            if open_:
                what = "not told by these data" if unknown in alignment.untold else "uncertain"
                where = f" of manoeuvre {m + 1}" if len(alignments) > 1 else ""
                size = f"+- {2 * sigma:.2g} {alignment.units[i]}"
                remarks.append(
                    f"{unknown}{where} is {what} ({size}), which alone leaves open {', '.join(open_)}."
                )
    return remarks

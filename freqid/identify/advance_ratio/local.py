"""Local estimates for the laws, taken from point models."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import COEFFICIENT
from freqid.core.errors import DataError
from freqid.core.results.advance_ratio import LocalDerivatives
from freqid.core.results.point import PointModel, ResponseModel, per
from freqid.core.sections.identification import factors_of

_SYMBOLS = {response: symbol for symbol, response in COEFFICIENT.items()}


def local_derivatives(points: Sequence[PointModel], ids: Sequence[str]) -> LocalDerivatives:
    """Return the derivatives that point models tell, each at its trim.

    Parameters
    ----------
    points : sequence of PointModel
        In coefficient form, so that what changes with the advance ratio is not the dynamic pressure.
    ids : sequence of str
        What each is called, for example its file.

    Returns
    -------
    LocalDerivatives
        ``CZ.alpha`` and the like; ``CZ.0`` is the constant term: the response where all regressors
        are zero.

    Raises
    ------
    DataError
        Where a point is not in coefficient form or states no advance ratio or angle of attack, or two
        points have other units, axes or vehicles.
    """
    columns: dict[str, str] = {}
    told: list[dict[str, tuple[list[str], Array, Array]]] = []
    for point, where in zip(points, ids, strict=True):
        _refuse_unfit(point, points[0], where)
        of: dict[str, tuple[list[str], Array, Array]] = {}
        for response, model in point.responses.items():
            symbol = _SYMBOLS[response]
            names = [f"{symbol}.{x}" for x in ("0", *model.regressors)]
            units = [per(model.unit, unit) for unit in ("1", *model.regressor_units)]
            for name, unit in zip(names, units, strict=True):
                if columns.setdefault(name, unit) != unit:
                    raise DataError(
                        f"{name} is in {unit}, in other points in {columns[name]}",
                        where=where,
                        remedy="identify all points alike",
                    )
            of[response] = (names, *expand_about_zero(model))
        told.append(of)
    names = tuple(sorted(columns, key=lambda name: list(COEFFICIENT).index(name.partition(".")[0])))
    estimate = np.full((len(points), len(names)), np.nan)
    covariance = np.full((len(points), len(names), len(names)), np.nan)
    for i, of in enumerate(told):
        places = [[names.index(name) for name in own] for own, _, _ in of.values()]
        every = np.concatenate(places)
        covariance[i][np.ix_(every, every)] = 0.0  # responses' errors are taken to be independent
        for at, (_, value, spread) in zip(places, of.values(), strict=True):
            estimate[i, at] = value
            covariance[i][np.ix_(at, at)] = spread
    return LocalDerivatives(
        ids=tuple(ids),
        names=names,
        units=tuple(columns[name] for name in names),
        advance_ratio=np.array([p.trim["advance_ratio"] for p in points]),
        alpha=np.array([p.trim["alpha"] for p in points]),
        airspeed=np.array([p.trim.get("V", np.nan) for p in points]),
        estimate=estimate,
        covariance=covariance,
    )


def expand_about_zero(model: ResponseModel) -> tuple[Array, Array]:
    """Return a response's constant term and derivatives about zero in place of the trim.

    Parameters
    ----------
    model : ResponseModel
        ``response = bias + sum_j estimate[j] (x[j] - trim[j])``; a product of regressors is that of their
        departures from the trim, and its own trim the mean of that.

    Returns
    -------
    estimate : ndarray, shape (1 + p,)
        Constant, then one for each regressor.
    covariance : ndarray, shape (1 + p, 1 + p)
    """
    turn = about_zero(model.regressors, model.trim)
    for j, (name, trim) in enumerate(zip(model.regressors, model.trim, strict=True)):
        if len(factors_of(name)) > 1:  # the bias is the load at the product's mean
            turn[0, 1 + j] -= trim
    value = np.append(model.bias, model.estimate)
    spread = np.zeros_like(turn)
    spread[0, 0] = model.bias_std_error**2  # independent of the estimates
    spread[1:, 1:] = model.covariance
    return turn @ value, turn @ spread @ turn.T


def about_zero(regressors: Sequence[str], trim: Array) -> Array:
    """Return the matrix from bias and derivatives about a trim to those about zero.

    The bias is the response where all departures from the trim are zero, those of products too.

    Parameters
    ----------
    regressors : sequence of str, length p
    trim : ndarray, shape (p,)

    Returns
    -------
    ndarray, shape (1 + p, 1 + p)
    """
    trims = dict(zip(regressors, np.asarray(trim).tolist(), strict=True))
    place = {name: 1 + j for j, name in enumerate(regressors)}
    turn = np.eye(1 + len(trims))
    for name, j in place.items():
        factors = factors_of(name)
        if len(factors) == 1:
            turn[0, j] -= trims[name]
            continue
        a, b = factors  # e (a - a0) (b - b0) = e a b - e b0 a - e a0 b + e a0 b0
        turn[0, j] += trims[a] * trims[b]
        turn[place[a], j] -= trims[b]
        turn[place[b], j] -= trims[a]
    return turn


def _refuse_unfit(point: PointModel, first: PointModel, where: str) -> None:
    if point.form != "coefficient":
        raise DataError(
            f"the point is in form '{point.form}', expected 'coefficient': forces change with dynamic "
            "pressure whatever the propellers do",
            where=where,
            remedy="identify it with --form coefficient",
        )
    for what in ("axes", "vehicle"):
        if getattr(point, what) != getattr(first, what):
            raise DataError(
                f"the point has {what} '{getattr(point, what)}', the first one '{getattr(first, what)}'",
                where=where,
                remedy="blend points of one vehicle and one kind",
            )
    if "advance_ratio" not in point.trim:
        raise DataError(
            f"the point states no advance ratio: {point.no_advance_ratio or 'its file does not hold one'}",
            where=where,
            remedy="identify it again with a scenario whose [[rotor]] state diameter_m, from a record with "
            "rotor speeds",
        )
    if "alpha" not in point.trim:
        raise DataError(
            "the point states no trim angle of attack, its record held no air data",
            where=where,
            remedy="log u v w or V alpha beta",
        )

"""Derivatives against the propellers' advance ratio: local estimates, laws, the whole model, and its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.layout import Attribute, Dataset, Nested, NestedSeries, ResultFile, Rows
from freqid.core.viewable import Viewable

FormName = Literal["mean", "one exponential", "two exponentials"]
FORMS: tuple[FormName, ...] = ("mean", "one exponential", "two exponentials")
"""Of a law, the simplest first: the number of exponentials is the place in the list."""


@dataclass(frozen=True, eq=False)
class LocalDerivatives:
    """Derivatives as n manoeuvres tell them one by one, each at its own trim.

    Attributes
    ----------
    ids : tuple of str, length n
        Of the manoeuvres.
    names, units : tuple of str, length p
        ``CZ.alpha`` is the derivative of CZ with respect to alpha, ``CZ.0`` the constant term.
    advance_ratio : ndarray, shape (n,)
        ``J = V / (n d)`` at the trim; inf where the propellers are stopped.
    alpha : ndarray, shape (n,)
        Angle of attack at the trim, rad.
    airspeed : ndarray, shape (n,)
        At the trim, m/s; nan where it is not known.
    estimate : ndarray, shape (n, p)
        nan where a manoeuvre does not tell a derivative.
    covariance : ndarray, shape (n, p, p)
        Of the estimates of one manoeuvre; manoeuvres are independent. nan in the rows and columns of what
        is not told.
    """

    ids: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    advance_ratio: Array
    alpha: Array
    airspeed: Array
    estimate: Array
    covariance: Array

    def __repr__(self) -> str:
        return f"<LocalDerivatives: {len(self.names)} derivatives of {len(self.ids)} manoeuvres>"

    @property
    def std_error(self) -> Array:
        """Standard errors, shape (n, p)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    def place(self, name: str) -> int:
        """Return the column of a derivative.

        Raises
        ------
        UsageError
            Where there is none of that name.
        """
        if name not in self.names:
            raise UsageError(f"there is no derivative '{name}'", remedy=nearest(name, self.names))
        return self.names.index(name)

    def of(self, rows: ArrayLike) -> LocalDerivatives:
        """Return some of the manoeuvres.

        Parameters
        ----------
        rows : array_like of int or bool, shape (m,) or (n,)
        """
        index = np.arange(len(self.ids))[np.asarray(rows)]
        return LocalDerivatives(
            ids=tuple(self.ids[i] for i in index),
            names=self.names,
            units=self.units,
            advance_ratio=self.advance_ratio[index],
            alpha=self.alpha[index],
            airspeed=self.airspeed[index],
            estimate=self.estimate[index],
            covariance=self.covariance[index],
        )


@dataclass(frozen=True)
class FormEvidence:
    """How well one form of law is supported by the local estimates.

    Attributes
    ----------
    form : {"mean", "one exponential", "two exponentials"}
    log_evidence : float
        Logarithm of the marginal likelihood, up to a constant that all forms share.
    probability : float
        Of the form, were the forms that were tried equally likely before.
    log_predictive : float
        Sum over manoeuvres of the log density of each one's estimate as predicted from all others.
    prediction_rms : float
        Root mean square of those predictions' errors, unit of the derivative.
    """

    form: FormName
    log_evidence: float
    probability: float
    log_predictive: float
    prediction_rms: float


@dataclass(frozen=True, eq=False)
class AdvanceRatioLaw:
    """One derivative against advance ratio: ``C(J) = C_inf + sum_k p_k exp(-r_k J)``.

    Attributes
    ----------
    name, unit : str
    form : {"mean", "one exponential", "two exponentials"}
        The simplest that the data support.
    unblown : float
        C_inf, the value with stopped propellers.
    amplitude, rate : ndarray, shape (k,)
        p and r; k is 0, 1 or 2.
    scatter : float
        Standard deviation of a trim's derivative about the law, beyond what the local standard errors
        explain: what else differs from manoeuvre to manoeuvre.
    draws : ndarray, shape (m, 1 + 2 l)
        Posterior draws ``C_inf p1 r1 p2 r2 ...``, of all forms in proportion to their probabilities, so that
        intervals allow for doubt about the form; unused terms are zero.
    forms : tuple of FormEvidence
        Those that were tried, the simplest first.
    lowest, highest : float
        Advance ratios that the law is made from; highest is the highest finite one.
    reaches_unblown : bool
        Whether stopped propellers are among the trims; else C_inf is extrapolated.
    points : int
        Number of manoeuvres.
    remarks : tuple of str
        What a reader should know before using the law, one sentence each.
    """

    name: str
    unit: str
    form: FormName
    unblown: float
    amplitude: Array
    rate: Array
    scatter: float
    draws: Array
    forms: tuple[FormEvidence, ...]
    lowest: float
    highest: float
    reaches_unblown: bool
    points: int
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        terms = "".join(f" {p:+.4g} exp(-{r:.3g} J)" for p, r in zip(self.amplitude, self.rate, strict=True))
        low, high = self.interval(np.inf)
        return (
            f"<AdvanceRatioLaw {self.name} = {self.unblown:.4g}{terms}: {self.form} of {self.points} "
            f"manoeuvres, C_inf {low:.4g} to {high:.4g}>"
        )

    def value(self, advance_ratio: ArrayLike) -> Array:
        """Return the law's value.

        Parameters
        ----------
        advance_ratio : array_like, shape (...,)
            inf is the unblown limit.

        Returns
        -------
        ndarray, shape (...,)
        """
        return law_value(self.unblown, self.amplitude, self.rate, advance_ratio)

    def increment(self, advance_ratio: ArrayLike) -> Array:
        """Return what blowing adds to the unblown value, shape of `advance_ratio`."""
        return self.value(advance_ratio) - self.unblown

    @cached_property
    def std_error(self) -> float:
        """Standard error of C_inf, as `std_error_at`."""
        return float(self.std_error_at(np.inf))

    def std_error_at(self, advance_ratio: ArrayLike) -> Array:
        """Return the standard error of the value, shape of `advance_ratio`.

        Half of the central 68.3 % of the draws: their standard deviation would be that of the least likely
        forms' extrapolations.
        """
        low, high = self.interval(advance_ratio, 0.683)
        return (high - low) / 2

    def drawn(self, advance_ratio: ArrayLike) -> Array:
        """Return the value in every posterior draw, shape (m, ...)."""
        j = np.asarray(advance_ratio, dtype=np.float64)
        columns = [column.reshape(-1, *([1] * j.ndim)) for column in self.draws.T]
        return columns[0] + sum(p * _decay(r, j) for p, r in zip(columns[1::2], columns[2::2], strict=True))

    def interval(self, advance_ratio: ArrayLike, confidence: float = 0.95) -> tuple[Array, Array]:
        """Return the limits of the value's interval, each of the shape of `advance_ratio`."""
        return self._quantiles(self.drawn(advance_ratio), confidence)

    def increment_interval(self, advance_ratio: ArrayLike, confidence: float = 0.95) -> tuple[Array, Array]:
        """Return the limits of the blowing increment's interval, each of the shape of `advance_ratio`."""
        increment = self.drawn(advance_ratio) - self.drawn(np.full(np.shape(advance_ratio), np.inf))
        return self._quantiles(increment, confidence)

    @staticmethod
    def _quantiles(values: Array, confidence: float) -> tuple[Array, Array]:
        tail = (1 - confidence) / 2
        low, high = np.quantile(values, [tail, 1 - tail], axis=0)
        return low, high


def law_value(unblown: float, amplitude: Array, rate: Array, advance_ratio: ArrayLike) -> Array:
    """Return ``C_inf + sum_k p_k exp(-r_k J)``, shape of `advance_ratio`.

    Parameters
    ----------
    unblown : float
    amplitude, rate : ndarray, shape (k,)
    advance_ratio : array_like
    """
    j = np.asarray(advance_ratio, dtype=np.float64)
    total = np.full(j.shape, float(unblown))
    for p, r in zip(amplitude, rate, strict=True):
        total = total + p * _decay(r, j)
    return total


def _decay(rate: Any, j: Array) -> Array:
    """Return exp(-rate J), zero at J = inf whatever the rate: a term that is not there has the rate zero."""
    finite = np.where(np.isfinite(j), j, 0.0)
    return np.where(np.isfinite(j), np.exp(-rate * finite), 0.0)


@dataclass(frozen=True, eq=False)
class TrimCluster:
    """Manoeuvres of neighbouring trim angles of attack, and the laws of their derivatives.

    Attributes
    ----------
    local : LocalDerivatives
        Of its manoeuvres.
    laws : mapping of str to AdvanceRatioLaw
        By derivative.
    """

    local: LocalDerivatives
    laws: Mapping[str, AdvanceRatioLaw]

    @property
    def alpha(self) -> float:
        """Mean angle of attack of the trims, rad."""
        return float(self.local.alpha.mean())

    def __getitem__(self, name: str) -> AdvanceRatioLaw:
        try:
            return self.laws[name]
        except KeyError:
            raise UsageError(f"there is no law of '{name}'", remedy=nearest(name, self.laws)) from None


@dataclass(frozen=True, eq=False)
class AdvanceRatioModel(Viewable):
    """The parametric global model of a blown aircraft: laws of all derivatives, by cluster.

    Attributes
    ----------
    clusters : tuple of TrimCluster
        Ascending in angle of attack.
    kind : {"global", "semi-local", "one-shot"}
        Whether the laws are made from local estimates, from estimates with some derivatives held at their
        laws, or from all manoeuvres of a cluster at once.
    vehicle : str
    held : tuple of str
        Derivatives that a semi-local refit held.
    provenance : dict
        JSON-compatible.
    remarks : tuple of str
        What a reader should know before using the model, one sentence each.
    """

    clusters: tuple[TrimCluster, ...]
    kind: str = "global"
    vehicle: str = ""
    held: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        alphas = ", ".join(f"{np.degrees(c.alpha):.3g}" for c in self.clusters)
        count = sum(len(c.local.ids) for c in self.clusters)
        return f"<AdvanceRatioModel, {self.kind}: {count} manoeuvres at trim alpha {alphas} deg>"

    @property
    def count(self) -> int:
        """Number of clusters."""
        return len(self.clusters)

    @property
    def names(self) -> tuple[str, ...]:
        """Derivatives, in their order."""
        return self.clusters[0].local.names

    def cluster_at(self, alpha: float) -> TrimCluster:
        """Return the cluster with the nearest trim.

        Parameters
        ----------
        alpha : float
            Angle of attack, rad.
        """
        return min(self.clusters, key=lambda c: float(np.abs(c.local.alpha - alpha).min()))

    def derivatives(
        self, advance_ratio: float, alpha: float, *, outside: Literal["refuse", "hold"] = "refuse"
    ) -> dict[str, float]:
        """Return all derivatives at one advance ratio and trim angle of attack.

        Parameters
        ----------
        advance_ratio : float
            inf with stopped propellers.
        alpha : float
            rad; the laws of the nearest cluster are used.
        outside : {"refuse", "hold"}
            What to do below the lowest advance ratio flown, where exponentials soon leave all reason.

        Raises
        ------
        UsageError
            Where the advance ratio is below the lowest flown and that is refused.
        """
        cluster = self.cluster_at(alpha)
        values = {}
        for name, law in cluster.laws.items():
            if advance_ratio < law.lowest * (1 - TRIM_SHARE) and outside == "refuse":
                raise UsageError(
                    f"advance ratio {advance_ratio:.3g} is below {law.lowest:.3g}, the lowest that the law "
                    f"of {name} is made from",
                    remedy="fly there, or ask for it to be held",
                )
            values[name] = float(law.value(max(advance_ratio, law.lowest)))
        return values


TRIM_SHARE = 0.03
"""Advance ratios that differ by less are one trim: airspeed is not held better during a manoeuvre."""


_CLUSTER = "cluster/{k}"
_LAW = f"{_CLUSTER}/law/{{name}}"
_LOCAL = {
    **{name: Attribute(f"{_CLUSTER}/local@{name}", json=True) for name in ("ids", "names", "units")},
    "advance_ratio": Dataset(f"{_CLUSTER}/local/advance_ratio", "1", ("ids",)),
    "alpha": Dataset(f"{_CLUSTER}/local/alpha", "rad", ("ids",)),
    "airspeed": Dataset(f"{_CLUSTER}/local/airspeed", "m/s", ("ids",)),
    "estimate": Dataset(f"{_CLUSTER}/local/estimate", "mixed", ("ids", "names")),
    "covariance": Dataset(f"{_CLUSTER}/local/covariance", "mixed", ("ids", "names", "names")),
}
_EVIDENCE = {
    "form": Attribute(f"{_LAW}@forms", json=True),
    **{
        name: Dataset(f"{_LAW}/{name}", "mixed")
        for name in ("log_evidence", "probability", "log_predictive", "prediction_rms")
    },
}
_NUMBERS = ("form", "unit", "unblown", "scatter", "lowest", "highest", "reaches_unblown", "points")
_ONE_LAW = {
    **{name: Attribute(f"{_LAW}@{name}") for name in _NUMBERS},
    "remarks": Attribute(f"{_LAW}@remarks", json=True),
    "amplitude": Dataset(f"{_LAW}/amplitude", "{unit}", ("term",)),
    "rate": Dataset(f"{_LAW}/rate", "1", ("term",)),
    "draws": Dataset(f"{_LAW}/draws", "mixed", ("draw", "column")),
    "forms": Rows(FormEvidence, _EVIDENCE),
}
_ONE_CLUSTER = {
    "local": Nested(LocalDerivatives, _LOCAL),
    "laws": NestedSeries(AdvanceRatioLaw, _ONE_LAW, "name", f"{_CLUSTER}@laws"),
}
_MODEL = {
    **{name: Attribute(f"@{name}") for name in ("kind", "vehicle")},
    **{name: Attribute(f"@{name}", json=True) for name in ("held", "remarks")},
    "provenance": Attribute("provenance@json", json=True),
    "clusters": NestedSeries(TrimCluster, _ONE_CLUSTER, "k", "cluster"),
    "count": Attribute("@clusters"),
}


def _check(model: AdvanceRatioModel) -> None:
    if not model.clusters:
        raise ValueError("it has no cluster")


FILE = ResultFile("freqid-advance-ratio", AdvanceRatioModel, _MODEL, check=_check)
write_advance_ratio, read_advance_ratio = FILE.write, FILE.read

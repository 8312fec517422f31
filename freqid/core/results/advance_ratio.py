"""Derivatives against the propellers' advance ratio: local estimates, laws, the whole model, and its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import ArrayLike

from freqid.core import store
from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
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


FORMAT = "freqid-advance-ratio"
_LOCAL = {"advance_ratio": "1", "alpha": "rad", "airspeed": "m/s", "estimate": "mixed", "covariance": "mixed"}
_EVIDENCE = ("log_evidence", "probability", "log_predictive", "prediction_rms")


def write_advance_ratio(path: Path, model: AdvanceRatioModel, scenario_sha256: str = "") -> None:
    """Write a model over advance ratio, whole or not at all.

    Parameters
    ----------
    path : Path
    model : AdvanceRatioModel
    scenario_sha256 : str
        Of the scenario that its points were identified with.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        file.attrs["kind"], file.attrs["vehicle"] = model.kind, model.vehicle
        for name in ("held", "remarks"):
            store.put_json(file, name, list(getattr(model, name)))
        store.put_json(file.create_group("provenance"), "json", model.provenance)
        file.attrs["clusters"] = len(model.clusters)
        for k, cluster in enumerate(model.clusters):
            local = file.create_group(f"cluster/{k}/local")
            for name in ("ids", "names", "units"):
                store.put_json(local, name, list(getattr(cluster.local, name)))
            for name, unit in _LOCAL.items():
                store.put(local, name, getattr(cluster.local, name), unit)
            store.put_json(store.subgroup(file, f"cluster/{k}"), "laws", list(cluster.laws))
            for name, law in cluster.laws.items():
                _fill_law(file.create_group(f"cluster/{k}/law/{name}"), law)

    store.write(path, FORMAT, fill, scenario_sha256)


def _fill_law(group: h5py.Group, law: AdvanceRatioLaw) -> None:
    for name in ("form", "unit", "unblown", "scatter", "lowest", "highest", "reaches_unblown", "points"):
        group.attrs[name] = getattr(law, name)
    store.put_json(group, "remarks", list(law.remarks))
    store.put_json(group, "forms", [f.form for f in law.forms])
    store.put(group, "amplitude", law.amplitude, law.unit)
    store.put(group, "rate", law.rate, "1")
    store.put(group, "draws", law.draws, "mixed")
    for name in _EVIDENCE:
        store.put(group, name, [getattr(f, name) for f in law.forms], "mixed")


def read_advance_ratio(path: Path) -> AdvanceRatioModel:
    """Read a model over advance ratio.

    Raises
    ------
    DataError
        Where the file is no intact one, or one of a newer layout.
    """
    with store.reading(path, FORMAT) as file:
        provenance = store.get_json(store.subgroup(file, "provenance"), "json")
        count = int(store.floats(file, "clusters")[0])
        if not isinstance(provenance, dict) or count < 1:
            raise ValueError("provenance or clusters are not as they are written")
        return AdvanceRatioModel(
            clusters=tuple(_read_cluster(store.subgroup(file, f"cluster/{k}")) for k in range(count)),
            kind=store.get_text(file, "kind"),
            vehicle=store.get_text(file, "vehicle"),
            held=tuple(map(str, store.get_json(file, "held"))),
            provenance=provenance,
            remarks=tuple(map(str, store.get_json(file, "remarks"))),
        )


def _read_cluster(group: h5py.Group) -> TrimCluster:
    at = store.subgroup(group, "local")
    ids, names, units = (tuple(map(str, store.get_json(at, name))) for name in ("ids", "names", "units"))
    arrays = {name: store.array(at, name) for name in _LOCAL}
    n, p = len(ids), len(names)
    expected = {"estimate": (n, p), "covariance": (n, p, p)}
    for name, values in arrays.items():
        if values.shape != expected.get(name, (n,)) or len(units) != p:
            raise ValueError(f"'{name}' has shape {values.shape}, expected {expected.get(name, (n,))}")
    laws = {
        name: _read_law(store.subgroup(group, f"law/{name}"), name) for name in store.get_json(group, "laws")
    }
    return TrimCluster(LocalDerivatives(ids, names, units, **arrays), laws)


def _read_law(group: h5py.Group, name: str) -> AdvanceRatioLaw:
    numbers = {n: store.floats(group, n)[0] for n in ("unblown", "scatter", "lowest", "highest")}
    forms = store.get_json(group, "forms")
    evidence = [store.array(group, n).tolist() for n in _EVIDENCE]
    form = store.get_text(group, "form")
    draws, amplitude, rate = (store.array(group, n) for n in ("draws", "amplitude", "rate"))
    if form not in FORMS or draws.ndim != 2 or draws.shape[1] % 2 != 1 or amplitude.shape != rate.shape:
        raise ValueError(f"the law of {name} is not as it is written")
    return AdvanceRatioLaw(
        name=name,
        unit=store.get_text(group, "unit"),
        form=form,
        amplitude=amplitude,
        rate=rate,
        draws=draws,
        forms=tuple(FormEvidence(*row) for row in zip(forms, *evidence, strict=True)),
        reaches_unblown=bool(store.floats(group, "reaches_unblown")[0]),
        points=int(store.floats(group, "points")[0]),
        remarks=tuple(map(str, store.get_json(group, "remarks"))),
        **numbers,
    )

"""What a point model regresses on what: manoeuvres as regressors about their means, and responses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import RESPONSE
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.core.results.fit import Fit
from freqid.core.results.point import ResponseModel
from freqid.core.sections.identification import Identification, factors_of
from freqid.identify.loads.explanatory import explanatory_variables, history
from freqid.identify.loads.wrench import AppliedWrench, applied_wrench, response_name
from freqid.identify.regress.estimators import Estimate
from freqid.identify.spectra.trend import remove_trend

# A regressor that moves by less than this share of its mean is constant but for rounding.
STILL_RMS = 1e-9


@dataclass(frozen=True, eq=False)
class Problem:
    """Regressors and responses of S manoeuvres.

    Attributes
    ----------
    settings : Identification
    names, units : tuple of str, length p
        Regressors of any response.
    x : tuple of ndarray, shape (p, N_s)
        Each manoeuvre's regressors about their own means.
    mean : ndarray, shape (S, p)
        Those means.
    trim : ndarray, shape (p,)
        Mean over all manoeuvres; what the model is expanded about.
    rms : ndarray, shape (p,)
        About a straight line in each manoeuvre.
    wrench : tuple of AppliedWrench
    dt : tuple of float
        s.
    share : ndarray, shape (S,)
        Of each manoeuvre in the time of all.
    """

    settings: Identification
    names: tuple[str, ...]
    units: tuple[str, ...]
    x: tuple[Array, ...]
    mean: Array
    trim: Array
    rms: Array
    wrench: tuple[AppliedWrench, ...]
    dt: tuple[float, ...]
    share: Array

    @classmethod
    def of(cls, maneuvers: Sequence[Maneuver], settings: Identification) -> Problem:
        """Gather regressors and responses.

        Raises
        ------
        DataError
            Where a channel is missing, or a regressor is constant.
        """
        names = tuple(dict.fromkeys(n for r in settings.responses for n in settings.regressors_of(r)))
        share = np.array([m.record.duration for m in maneuvers])
        share = share / share.sum()
        trim_of = _trim_of_factors(maneuvers, names, share)
        both = [explanatory_variables(m, names, trim_of) for m in maneuvers]
        mean = np.array([x.mean(axis=1) for x, _ in both])
        x = tuple(x - level[:, None] for (x, _), level in zip(both, mean, strict=True))
        dt = tuple(m.record.dt for m in maneuvers)
        square = [remove_trend(x_s, step, "line").x.var(axis=1) for x_s, step in zip(x, dt, strict=True)]
        trim, rms = share @ mean, np.sqrt(share @ np.array(square))
        _refuse_still(names, rms, trim)
        return cls(
            settings=settings,
            names=names,
            units=both[0][1],
            x=x,
            mean=mean,
            trim=trim,
            rms=rms,
            wrench=tuple(measured_responses(m, settings) for m in maneuvers),
            dt=dt,
            share=share,
        )

    def groups(self) -> Iterable[tuple[list[int], list[int]]]:
        """Yield rows of responses that share their regressors, and the rows of those regressors."""
        shared: dict[tuple[str, ...], list[int]] = {}
        for r, response in enumerate(self.settings.responses):
            shared.setdefault(self.settings.regressors_of(response), []).append(r)
        for regressors, rows in shared.items():
            yield rows, [self.names.index(n) for n in regressors]

    def models(
        self,
        rows: list[int],
        columns: list[int],
        found: Estimate,
        bias: tuple[Array, Array],
        rmse: Array,
        fits: Sequence[dict[str, Fit]],
        noise: tuple[Array, Array] | None = None,
    ) -> dict[str, ResponseModel]:
        """Collect what an estimate says about its responses.

        Parameters
        ----------
        rows, columns : list of int
            One of `groups`, of R responses.
        found : Estimate
        bias : tuple of 2 ndarray, shape (R,)
            Responses at the trim and their standard errors.
        rmse : ndarray, shape (R,)
        fits : sequence of dict of str to Fit, length R
        noise : tuple of 2 ndarray, shape (R,), optional
            Distortion, and the R2 that noise allows.
        """
        fit, nuisance = found.fit, len(found.fit.nuisance_names)
        lower, upper = fit.interval(self.settings.confidence)
        models = {}
        for i, row in enumerate(rows):
            name = self.settings.responses[row]
            models[name] = ResponseModel(
                response=name,
                unit=self.wrench[0].units[row],
                regressors=fit.names,
                regressor_units=tuple(self.units[j] for j in columns),
                trim=self.trim[columns],
                regressor_rms=self.rms[columns],
                estimate=fit.estimate[i],
                std_error=fit.std_error[i],
                covariance=fit.covariance[i],
                lower=lower[i],
                upper=upper[i],
                bias=float(bias[0][i]),
                bias_std_error=float(bias[1][i]),
                r2=float(fit.r2[i]),
                pse=float(fit.pse[i]),
                rmse=float(rmse[i]),
                fit_error=float(fit.fit_error[i]),
                t_statistic=fit.t_statistic[i],
                variance_inflation=fit.variance_inflation,
                correlation=fit.correlation[i],
                condition_index=fit.collinearity.condition_index,
                variance_proportion=fit.collinearity.proportion[:, nuisance:],
                # end terms that only resemble each other are no matter: their values are not asked for
                inseparable=tuple(g for g in fit.collinearity.inseparable() if set(g) & set(fit.names)),
                fit=fits[i],
                errors_in_variables=found.errors_in_variables[i],
                distortion=None if noise is None else float(noise[0][i]),
                r2_ceiling=None if noise is None else float(noise[1][i]),
            )
        return models


def measured_responses(maneuver: Maneuver, settings: Identification) -> AppliedWrench:
    """Return the responses asked for, reconstructed or as the record holds them."""
    if settings.response_source == "reconstruct":
        return applied_wrench(
            maneuver,
            settings.responses,
            form=settings.form,
            axes=settings.axes,
            angular_acceleration=settings.angular_acceleration,
        )
    if settings.form == "specific":
        raise UsageError(
            "a record holds responses as forces or as coefficients, not per mass",
            remedy="use form 'force' or 'coefficient', or response_source 'reconstruct'",
        )
    names = [response_name(r, settings.form) for r in settings.responses]
    direct = maneuver.record.matrix(f"response/{n}" for n in names)
    return AppliedWrench(
        names=settings.responses,
        units=tuple(RESPONSE[n][0] for n in names),
        direct=direct,
        momentum=np.zeros_like(direct),
    )


def numbered(kind: str, maneuver: int) -> str:
    """Return the name of one manoeuvre's fit: ``time``, then ``time 2`` and so on."""
    return kind if maneuver == 0 else f"{kind} {maneuver + 1}"


def _trim_of_factors(maneuvers: Sequence[Maneuver], names: Sequence[str], share: Array) -> dict[str, float]:
    """Return the trim of each factor of a product: products are of departures from it, in all manoeuvres."""
    products = [factors for factors in map(factors_of, names) if len(factors) > 1]
    factors = dict.fromkeys(factor for each in products for factor in each)
    return {name: float(share @ [history(m, name).mean() for m in maneuvers]) for name in factors}


def _refuse_still(names: tuple[str, ...], rms: Array, trim: Array) -> None:
    """Refuse regressors that, but for a straight line, move by no more than their rounding."""
    still = np.flatnonzero(rms <= STILL_RMS * np.abs(trim))
    if still.size:
        name, level = names[still[0]], trim[still[0]]
        raise DataError(
            f"regressor '{name}' is constant, or a straight line, over the manoeuvre (mean {level:.6g}, rms "
            f"about the line {rms[still[0]]:.2g}), so its parameter cannot be estimated",
            remedy="drop it from the regressors, or excite it",
        )

"""What a model says of a flight before it is flown, sealed by a checksum, and the flight beside it; files."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import msgspec
import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.layout import Attribute, Attributes, Dataset, Nested, NestedSeries, ResultFile
from freqid.core.results import design as design_file
from freqid.core.results.design import MultisineDesign, SampledInputs
from freqid.core.results.point import per
from freqid.core.scenario import Reference
from freqid.core.viewable import Viewable

LEVEL = 0.95
"""Share of the samples that a band is meant to hold."""
QUANTILE = 1.959964
"""Standard deviations of a normal variable on either side of its mean that hold this share."""

WRENCH_HZ = "wrench_up_to_hz"
"""In the settings: up to which free-running wrenches are compared; ``highest_hz`` where it is absent."""


@dataclass(frozen=True)
class PredictedChannel:
    """One channel of the free-running response: the change from the trim, and how far it may be off.

    Attributes
    ----------
    name, unit : str
    kind : {"state", "effector", "wrench"}
        A wrench is what is reconstructed from the record, up to the model's highest line.
    trim : float
        What the change is from, `unit`; nan where the model does not tell.
    change : ndarray, shape (sample,)
    parameter_std : ndarray, shape (sample,)
        One sigma from the covariance of the parameters, by sample.
    residual_std, gust_std, noise_std : float
        One sigma from what the fit left, from stated gusts and from the channel's own sensor.
    band_std : float
        One sigma of these three within the design's band: what lines without excitation are held against.
    """

    name: str
    unit: str
    kind: str
    trim: float
    change: Array
    parameter_std: Array
    residual_std: float
    gust_std: float
    noise_std: float
    band_std: float

    @property
    def std(self) -> Array:
        """One sigma of all together, shape (sample,)."""
        steady = self.residual_std**2 + self.gust_std**2 + self.noise_std**2
        return np.sqrt(self.parameter_std**2 + steady)

    @property
    def lower(self) -> Array:
        """Lower limit of the band about the change, shape (sample,)."""
        return self.change - QUANTILE * self.std

    @property
    def upper(self) -> Array:
        """Upper limit of the band about the change, shape (sample,)."""
        return self.change + QUANTILE * self.std


@dataclass(frozen=True)
class PredictedResponse:
    """The linear model of one response, which predicts it from the states that will be flown.

    Attributes
    ----------
    response, unit : str
    regressors, regressor_units : tuple of str, length p
    trim, regressor_rms : ndarray, shape (p,)
        What the model is expanded about, and what it was identified with.
    estimate : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
    bias : float
        Response at the trim.
    residual_rms : float
        Of the fit in time, up to its highest line; nan where the model does not keep it.
    residual_hz : ndarray, shape (line,)
        Lines of the fit; of several manoeuvres one after the other.
    residual : ndarray of complex, shape (line,)
        What the fit left there, as an amplitude density: its squared magnitude is one-sided, unit2/Hz.
    residual_noise : ndarray, shape (line,)
        Share of that which is noise alone, as an amplitude density; nan where the fit could not tell.
    duration, rate_hz : float
        Of the manoeuvre that was fitted, s, and of its samples; nan where the model does not keep it.
    """

    response: str
    unit: str
    regressors: tuple[str, ...]
    regressor_units: tuple[str, ...]
    trim: Array
    regressor_rms: Array
    estimate: Array
    covariance: Array
    bias: float
    residual_rms: float
    residual_hz: Array
    residual: Complex
    residual_noise: Array
    duration: float
    rate_hz: float

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Of the parameters, length p."""
        return tuple(per(self.unit, unit) for unit in self.regressor_units)

    @property
    def std_error(self) -> Array:
        """Of the parameters, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True)
class Assumption:
    """What a prediction takes for granted, and from where on it is called wrong.

    Attributes
    ----------
    name : str
    statement : str
        A sentence without a full stop.
    limit : float
        Of the figure that the flight is held against, in `unit`; nan where nothing in a record tells.
    unit : str
    """

    name: str
    statement: str
    limit: float
    unit: str


@dataclass(frozen=True)
class Prediction(Viewable):
    """What a model says that an aircraft will do when a design is flown.

    Attributes
    ----------
    vehicle : str
    reference : Reference
        The condition that it is for.
    model, design_name : str
        Files, or what they were given as.
    model_sha256, design_sha256 : str
        Of these files; of the contents where there is no file.
    model_kind : {"point", "global"}
    inputs : SampledInputs
        The design as it is to be flown.
    design : MultisineDesign, optional
        Its tones; None of classic inputs.
    time : ndarray, shape (sample,)
        s, from the design's start.
    highest_hz : float
        Up to which wrenches of one step are compared; infinite where the model was identified in time.
    channels : tuple of PredictedChannel
        Free-running response: model, control law and actuators driven by the design alone.
    responses : tuple of PredictedResponse
        What predicts the wrench from the states that are flown.
    assumptions : tuple of Assumption
    settings : dict
        Seed, draws, noise, gusts, control law and scenario; JSON-compatible.
    remarks : tuple of str
        What a reader should know before using it, one sentence each.
    date : str
        UTC, ISO 8601.
    checksum : str
        SHA-256 over all of the above.
    """

    vehicle: str
    reference: Reference
    model: str
    model_sha256: str
    model_kind: str
    design_name: str
    design_sha256: str
    inputs: SampledInputs
    time: Array
    highest_hz: float
    channels: tuple[PredictedChannel, ...]
    responses: tuple[PredictedResponse, ...]
    assumptions: tuple[Assumption, ...]
    settings: dict[str, Any]
    date: str
    design: MultisineDesign | None = None
    remarks: tuple[str, ...] = ()
    checksum: str = ""

    def __repr__(self) -> str:
        at = self.reference.id or f"u {self.reference.u:.4g} m/s"
        return (
            f"<Prediction for {self.vehicle!r} at {at}: {len(self.channels)} channels over "
            f"{self.time[-1]:.4g} s, sealed {self.date}, {self.checksum[:12]}>"
        )

    def __getitem__(self, name: str) -> PredictedChannel:
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise UsageError(
            f"the prediction has no channel '{name}'", remedy=nearest(name, (c.name for c in self.channels))
        )

    def assumption(self, name: str) -> Assumption:
        """Return the assumption that has a `name`."""
        return next(one for one in self.assumptions if one.name == name)

    def seal(self) -> Prediction:
        """Return the prediction with the checksum of its contents."""
        return replace(self, checksum=digest_of(replace(self, checksum="")))

    def refuse_edited(self) -> None:
        """Raise where the contents are not those that were sealed.

        Raises
        ------
        DataError
        """
        found = digest_of(replace(self, checksum=""))
        if found != self.checksum:
            raise DataError(
                f"was edited after it was sealed: its contents have the checksum {found[:12]}, the seal "
                f"says {self.checksum[:12] or 'nothing'}",
                remedy="use the file as it was written, or predict again before the flight",
            )


def digest_of(value: Any) -> str:
    """Return the SHA-256 of a result's contents, the same before it is written and after it is read."""
    digest = hashlib.sha256()
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    """Add one value; a type and a length go first, so that no two values look alike."""
    if isinstance(value, msgspec.Struct):
        value = msgspec.to_builtins(value)
    if dataclasses.is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        kind = value.dtype.str if value.size else "of nothing"  # a file keeps no type of no numbers
        digest.update(f"array {kind} {value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Mapping):
        digest.update(f"table {len(value)}".encode())
        for key in sorted(value):
            _feed(digest, key)
            _feed(digest, value[key])
    elif isinstance(value, tuple | list):
        digest.update(f"row {len(value)}".encode())
        for one in value:
            _feed(digest, one)
    elif isinstance(value, float | np.floating):
        digest.update(f"number {float(value).hex()}".encode())
    else:
        digest.update(f"value {json.dumps(value)}".encode())


_CHANNEL = {
    "unit": Attribute("channel/{name}@units"),
    "kind": Attribute("channel/{name}@kind"),
    **{
        name: Attribute(f"channel/{{name}}@{name}")
        for name in ("trim", "residual_std", "gust_std", "noise_std", "band_std")
    },
    **{
        name: Dataset(f"channel/{{name}}/{name}", "{unit}", ("sample",))
        for name in ("change", "parameter_std")
    },
    **{name: Dataset(f"channel/{{name}}/{name}", "{unit}") for name in ("lower", "upper")},
}
_AT = "parameter/{response}"
_P = ("regressors",)
_RESPONSE = {
    "unit": Attribute(f"{_AT}@units"),
    **{name: Attribute(f"{_AT}@{name}") for name in ("bias", "residual_rms", "duration", "rate_hz")},
    "regressors": Attribute(f"{_AT}@regressors", json=True),
    "regressor_units": Attribute(f"{_AT}@regressor_units", json=True, axes=_P),
    "estimate": Dataset(f"{_AT}/{{regressors}}/estimate", "{parameter_units}", _P),
    "std_error": Dataset(f"{_AT}/{{regressors}}/std_error", "{parameter_units}"),
    "trim": Dataset(f"{_AT}/{{regressors}}/trim", "{regressor_units}", _P),
    "regressor_rms": Dataset(f"{_AT}/{{regressors}}/regressor_rms", "{regressor_units}", _P),
    "covariance": Dataset("covariance/{response}", "mixed", ("regressors", "regressors")),
    "residual_hz": Dataset("residual/{response}/frequency", "Hz", ("line",)),
    "residual": Dataset("residual/{response}/density", "{unit}/sqrt(Hz)", ("line",)),
    "residual_noise": Dataset("residual/{response}/noise", "{unit}/sqrt(Hz)", ("line",)),
}
_ASSUMPTION = {name: Attribute(f"assumption/{{name}}@{name}") for name in ("statement", "limit", "unit")}
_PREDICTION = {
    **{
        name: Attribute(f"@{name}")
        for name in (
            "vehicle",
            "model",
            "model_sha256",
            "model_kind",
            "design_name",
            "design_sha256",
            "highest_hz",
            "date",
            "checksum",
        )
    },
    "reference": Attributes("reference"),
    "settings": Attribute("settings@json", json=True),
    "remarks": Attribute("@remarks", json=True),
    "inputs": Nested(SampledInputs, design_file.layout_of_samples("design")),
    "design": Nested(MultisineDesign, design_file.layout_of_multisines("design")),
    "time": Dataset("time", "s", ("sample",)),
    "channels": NestedSeries(PredictedChannel, _CHANNEL, "name", "@channels"),
    "responses": NestedSeries(PredictedResponse, _RESPONSE, "response", "@responses"),
    "assumptions": NestedSeries(Assumption, _ASSUMPTION, "name", "@assumptions"),
}
FILE = ResultFile("freqid-prediction", Prediction, _PREDICTION, check=Prediction.refuse_edited)


@dataclass(frozen=True)
class ChannelScore:
    """One prediction beside what was flown.

    Attributes
    ----------
    kind : {"free-run", "one-step"}
        Driven by the design alone, or predicted from the states that were flown.
    name, unit : str
    time : ndarray, shape (sample,)
        s, from the design's start.
    measured, predicted : ndarray, shape (sample,)
        Each about its own straight line: a point model knows neither the trim nor how it drifts, as a battery
        empties. What was taken away is in `offset` and `drift`.
    std : ndarray, shape (sample,)
        One sigma of the difference, as predicted.
    offset : float
        Mean measured less mean predicted; nan where the model does not tell the trim.
    drift : float
        Slope measured less slope predicted, `unit` per s.
    """

    kind: str
    name: str
    unit: str
    time: Array
    measured: Array
    predicted: Array
    std: Array
    offset: float
    drift: float

    @property
    def coverage(self) -> float:
        """Share of the samples in the 95 % band."""
        return float(np.mean(np.abs(self.measured - self.predicted) <= QUANTILE * self.std))

    @property
    def rmse(self) -> float:
        """Root mean square of the difference about the lines."""
        return float(np.sqrt(np.mean((self.measured - self.predicted) ** 2)))

    @property
    def expected_rmse(self) -> float:
        """What `rmse` was predicted to be."""
        return float(np.sqrt(np.mean(self.std**2)))

    @property
    def theil(self) -> float:
        """Theil's inequality coefficient about the trim: 0 is perfect, 1 is none at all."""
        shift = self.offset if np.isfinite(self.offset) else 0.0
        sizes = [np.sqrt(np.mean(x**2)) for x in (self.measured + shift, self.predicted)]
        error = float(np.sqrt(self.rmse**2 + shift**2))
        return error / float(sum(sizes)) if sum(sizes) else float("nan")

    @property
    def shares(self) -> tuple[float, float, float]:
        """Shares of bias, variance and covariance in the mean squared error, summing to one.

        References
        ----------
        Theil, *Economic Forecasts and Policy*, 2nd ed., 1961, sec. 2.5: ``(mean P - mean A)^2``,
        ``(s_P - s_A)^2`` and ``2 (1 - r) s_P s_A``. Jategaonkar, *Flight Vehicle System Identification*,
        2nd ed., ch. 11.
        """
        shift = self.offset if np.isfinite(self.offset) else 0.0
        s_a, s_p = float(self.measured.std()), float(self.predicted.std())
        mixed = float(
            np.mean((self.measured - self.measured.mean()) * (self.predicted - self.predicted.mean()))
        )
        parts = np.array([shift**2, (s_p - s_a) ** 2, 2 * (s_p * s_a - mixed)])
        total = parts.sum()
        bias, variance, covariance = parts / total if total else np.full(3, np.nan)
        return float(bias), float(variance), float(covariance)

    @property
    def bias_share(self) -> float:
        """Share of the means' difference."""
        return self.shares[0]

    @property
    def variance_share(self) -> float:
        """Share of unequal sizes."""
        return self.shares[1]

    @property
    def covariance_share(self) -> float:
        """Share of what is not in step."""
        return self.shares[2]


@dataclass(frozen=True)
class Check:
    """One assumption held against the flight.

    Attributes
    ----------
    name, statement : str
        Of the assumption.
    held : {"yes", "no", "not testable"}
    evidence : str
        What was found, and what it was held against.
    """

    name: str
    statement: str
    held: str
    evidence: str


@dataclass(frozen=True)
class Score(Viewable):
    """A sealed prediction beside the flight.

    Attributes
    ----------
    prediction, record : str
        Files.
    checksum : str
        Of the prediction.
    fingerprint : str
        Of the record.
    vehicle : str
    date, flown : str
        When the prediction was sealed, and when the record says that it was flown or written; UTC.
    start_s : float
        When the design starts, on the record's clock.
    gate : float
        Lowest mean coverage that is asked for, of each kind.
    channels : tuple of ChannelScore
    checks : tuple of Check
    """

    prediction: str
    record: str
    checksum: str
    fingerprint: str
    vehicle: str
    date: str
    flown: str
    start_s: float
    gate: float
    channels: tuple[ChannelScore, ...] = field(repr=False)
    checks: tuple[Check, ...] = field(repr=False)

    def __repr__(self) -> str:
        shares = ", ".join(f"{kind} {100 * share:.1f} %" for kind, share in self.coverage.items())
        failed = ", ".join(self.failed) or "none"
        return f"<Score of {self.prediction!r}: in the bands {shares}; failed: {failed}>"

    @property
    def coverage(self) -> dict[str, float]:
        """Mean share of samples in the bands over the channels, by kind."""
        kinds = dict.fromkeys(c.kind for c in self.channels)
        return {k: float(np.mean([c.coverage for c in self.channels if c.kind == k])) for k in kinds}

    @property
    def passed(self) -> bool:
        """Whether the coverage of every kind reaches the gate."""
        return all(share >= self.gate for share in self.coverage.values())

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the assumptions that did not hold."""
        return tuple(check.name for check in self.checks if check.held == "no")

    def __getitem__(self, name: str) -> ChannelScore:
        """Return a channel by ``kind/name``, or by its name alone where only one kind has it."""
        known = {f"{c.kind}/{c.name}": c for c in self.channels}
        found = [c for key, c in known.items() if name in (key, c.name)]
        if len(found) != 1:
            raise UsageError(
                f"'{name}' names {len(found)} channels of the score", remedy=nearest(name, known)
            )
        return found[0]


_SCORED = "channel/{number}"
_CHANNEL_SCORE = {
    **{name: Attribute(f"{_SCORED}@{name}") for name in ("kind", "name", "unit", "offset", "drift")},
    **{name: Attribute(f"{_SCORED}@{name}") for name in ("coverage", "rmse", "expected_rmse", "theil")},
    **{name: Attribute(f"{_SCORED}@{name}") for name in ("bias_share", "variance_share", "covariance_share")},
    "time": Dataset(f"{_SCORED}/time", "s", ("sample",)),
    **{
        name: Dataset(f"{_SCORED}/{name}", "{unit}", ("sample",)) for name in ("measured", "predicted", "std")
    },
}
_CHECK = {name: Attribute(f"check/{{name}}@{name}") for name in ("statement", "held", "evidence")}
_SCORE = {
    **{
        name: Attribute(f"@{name}")
        for name in (
            "prediction",
            "record",
            "checksum",
            "fingerprint",
            "vehicle",
            "date",
            "flown",
            "start_s",
            "gate",
        )
    },
    "channels": NestedSeries(ChannelScore, _CHANNEL_SCORE, "number", "channel"),
    "checks": NestedSeries(Check, _CHECK, "name", "@checks"),
}
SCORE_FILE = ResultFile("freqid-score", Score, _SCORE)

"""Results as tables: one row for each sample, parameter, line or explanation."""

from __future__ import annotations

from dataclasses import asdict
from functools import singledispatch
from typing import Any

import numpy as np
import pandas as pd

from freqid.blend.corridor_study import StudyResults
from freqid.blend.global_model import GlobalModel
from freqid.blend.semi_local.advance_ratio_study import CampaignStudy
from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.advance_ratio import AdvanceRatioModel
from freqid.core.results.corridor import Corridor
from freqid.core.results.design import ClassicDesign, MultisineDesign, SampledInputs
from freqid.core.results.diagnosis import GapDiagnosis
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.core.results.judged.monte_carlo import MonteCarlo
from freqid.core.results.loop_margins import LoopMargins, unit_of
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel, per
from freqid.core.results.prediction import Prediction, Score
from freqid.core.results.rivals import Rivals
from freqid.design.multisine.orthogonal_set import sampled
from freqid.identify.sensors.errors import SensorErrors


@singledispatch
def frame_of(result: Any) -> pd.DataFrame:
    """Return a result as a table.

    Raises
    ------
    UsageError
        For something that has none.
    """
    raise UsageError(f"a {type(result).__name__} has no table", remedy="look at its attributes")


@frame_of.register
def _of_record(record: FlightRecord) -> pd.DataFrame:
    index = pd.Index(record.time, name="time (s)")
    return pd.DataFrame({f"{n} ({c.unit})": c.values for n, c in record.channels.items()}, index=index)


@frame_of.register
def _of_maneuver(maneuver: Maneuver) -> pd.DataFrame:
    return _of_record(maneuver.record)


@frame_of.register
def _of_samples(inputs: SampledInputs) -> pd.DataFrame:
    names = [f"{name} ({unit})" for name, unit in zip(inputs.names, inputs.units, strict=True)]
    return pd.DataFrame(inputs.values.T, index=pd.Index(inputs.time, name="time (s)"), columns=names)


@frame_of.register
def _of_design(design: MultisineDesign | ClassicDesign) -> pd.DataFrame:
    return _of_samples(samples_of(design))


def samples_of(design: MultisineDesign | ClassicDesign) -> SampledInputs:
    """Return the samples of a design."""
    return sampled(design) if isinstance(design, MultisineDesign) else design.inputs


@frame_of.register
def _of_point(model: PointModel) -> pd.DataFrame:
    rows = []
    for name, r in model.responses.items():
        units = [per(r.unit, unit) for unit in r.regressor_units]
        columns = zip(r.regressors, r.estimate, r.std_error, r.lower, r.upper, units, strict=True)
        rows += [(name, *row) for row in columns]
        rows.append((name, "bias", r.bias, r.bias_std_error, np.nan, np.nan, r.unit))
    head = ["response", "parameter", "estimate", "std_error", "lower", "upper", "unit"]
    return pd.DataFrame(rows, columns=head)


@frame_of.register
def _of_output_error(found: OutputErrorModel) -> pd.DataFrame:
    columns = {"parameter": found.names, "estimate": found.estimate, "std_error": found.std_error}
    columns |= {"lower": found.lower, "upper": found.upper, "start": found.start, "unit": found.units}
    return pd.DataFrame(columns)


@frame_of.register
def _of_corridor(corridor: Corridor) -> pd.DataFrame:
    tables = []
    for name, k in corridor.responses.items():
        units = [per(k.unit, unit) for unit in k.regressor_units]
        estimates = [*zip(k.regressors, k.estimate, k.std_error, units, strict=True)]
        for parameter, estimate, error, unit in [*estimates, ("bias", k.bias, k.bias_std_error, k.unit)]:
            tables.append(
                pd.DataFrame(
                    {
                        "condition": corridor.ids,
                        "u (m/s)": corridor.u,
                        "rho (kg/m3)": corridor.rho,
                        "response": name,
                        "parameter": parameter,
                        "estimate": estimate,
                        "std_error": error,
                        "unit": unit,
                    }
                )
            )
    return pd.concat(tables, ignore_index=True)


@frame_of.register
def _of_global(model: GlobalModel) -> pd.DataFrame:
    return _of_corridor(model.corridor)


@frame_of.register
def _of_advance_ratio(model: AdvanceRatioModel) -> pd.DataFrame:
    rows = []
    for cluster in model.clusters:
        for name, law in cluster.laws.items():
            low, high = law.interval(np.inf)
            probability = next(f.probability for f in law.forms if f.form == law.form)
            terms = (
                [*law.amplitude, *[np.nan] * (2 - law.rate.size)],
                [*law.rate, *[np.nan] * (2 - law.rate.size)],
            )
            pairs = [x for pair in zip(*terms, strict=True) for x in pair]
            where = (np.degrees(cluster.alpha), name, law.form, probability)
            rows.append((*where, law.unblown, law.std_error, low, high, *pairs, law.scatter, law.unit))
    head = ["trim alpha (deg)", "derivative", "form", "probability", "unblown", "std_error", "lower", "upper"]
    return pd.DataFrame(rows, columns=[*head, "p1", "rate1", "p2", "rate2", "scatter", "unit"])


@frame_of.register
def _of_campaign(study: CampaignStudy) -> pd.DataFrame:
    return pd.concat([_of_advance_ratio(m).assign(model=m.kind) for m in study.models], ignore_index=True)


@frame_of.register
def _of_response(response: FrequencyResponse) -> pd.DataFrame:
    tables = []
    for o, output in enumerate(response.outputs):
        for i, input_ in enumerate(response.inputs):
            value = response.value[o, i]
            tables.append(
                pd.DataFrame(
                    {
                        "output": output,
                        "input": input_,
                        "frequency (Hz)": response.frequencies_hz,
                        "gain": np.abs(value),
                        "phase (rad)": np.angle(value),
                        "std_error": response.std_error[o, i],
                        "coherence": response.coherence[o, i],
                        "unit": f"{response.output_units[o]} per {response.input_units[i]}",
                    }
                )
            )
    return pd.concat(tables, ignore_index=True)


@frame_of.register
def _of_margins(found: LoopMargins) -> pd.DataFrame:
    rows = []
    for k, name in enumerate(found.ids):
        others = {
            n: dict(zip(found.figures, one.estimate[:, k], strict=True)) for n, one in found.beside.items()
        }
        for path, (estimate, low, high) in found[name].items():
            kind, place, figure = path.split("/")
            beside = [others[n][path] for n in others]
            where = (name, found.u[k], found.rho[k], kind, place, figure)
            rows.append((*where, estimate, low, high, unit_of(path), *beside))
    head = [
        "condition",
        "u (m/s)",
        "rho (kg/m3)",
        "kind",
        "of",
        "figure",
        "estimate",
        "lower",
        "upper",
        "unit",
    ]
    return pd.DataFrame(rows, columns=[*head, *found.beside])


@frame_of.register
def _of_diagnosis(d: GapDiagnosis) -> pd.DataFrame:
    w = d.which
    rows = [(name, p, name in w.set, w.places.get(name, "")) for name, p in w.probabilities.items()]
    table = pd.DataFrame(rows, columns=["effect", "probability", "in the set", "place"])
    return table.sort_values("probability", ascending=False, ignore_index=True)


@frame_of.register
def _of_rivals(found: Rivals) -> pd.DataFrame:
    rows = [
        (c.response, *c.band_hz, c.regime, c.misfit_a.value, c.misfit_b.value, c.p_adjusted, c.nearer)
        for c in (found.overall, *found.contests)
    ]
    head = ["response", "from (Hz)", "to (Hz)", "regime", "misfit A", "misfit B", "p", "nearer"]
    return pd.DataFrame(rows, columns=head)


@frame_of.register
def _of_study(results: StudyResults) -> pd.DataFrame:
    rows = [
        (p.id, p.model.reference.u, name, r.unit, r.r2, p.modelling_rmse(name), p.prediction_rmse(name))
        for p in results.points
        for name, r in p.model.responses.items()
    ]
    head = ["condition", "u (m/s)", "response", "unit", "R2", "rmse", "rmse of a flight not used"]
    return pd.DataFrame(rows, columns=head)


@frame_of.register
def _of_estimates(found: SensorErrors) -> pd.DataFrame:
    columns = {"error": found.names, "estimate": found.estimate, "std_error": found.std_error}
    return pd.DataFrame(columns | {"unit": found.units})


@frame_of.register
def _of_prediction(prediction: Prediction) -> pd.DataFrame:
    """Return change and limits of the band by channel over time."""
    columns = {}
    for c in prediction.channels:
        columns |= {f"{c.name} ({c.unit})": c.change, f"{c.name} lower": c.lower, f"{c.name} upper": c.upper}
    return pd.DataFrame(columns, index=pd.Index(prediction.time, name="time (s)"))


@frame_of.register
def _of_score(score: Score) -> pd.DataFrame:
    rows = [
        (c.kind, c.name, c.unit, c.coverage, c.rmse, c.expected_rmse, c.offset, c.drift, c.theil, *c.shares)
        for c in score.channels
    ]
    head = ["kind", "channel", "unit", "coverage", "rmse", "expected_rmse", "offset", "drift", "theil"]
    return pd.DataFrame(rows, columns=[*head, "bias_share", "variance_share", "covariance_share"])


@frame_of.register
def _of_campaign_cases(found: MonteCarlo) -> pd.DataFrame:
    return pd.DataFrame([asdict(m) for m in found.measured])

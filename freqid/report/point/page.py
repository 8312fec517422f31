"""One self-contained page about a point model, for the people who review it."""

from __future__ import annotations

from typing import Any

from freqid import __version__
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, parse_span
from freqid.core.results.point import PointModel
from freqid.core.scenario import Gates
from freqid.report.kit import notation
from freqid.report.kit.pictures import collinearity_pictures, data_pictures
from freqid.report.kit.rendering import render
from freqid.report.point.estimator_tables import difference_table
from freqid.report.point.response_pictures import (
    fit_pictures,
    maneuvers_of,
    parameter_picture,
    prediction_pictures,
)
from freqid.report.point.sensor_tables import longest_cut, sensor_accounts, sensor_tables
from freqid.report.point.tables import channels, facts, parameters, scores, summary
from freqid.report.point.verdict import verdict


def build_page(model: PointModel, record: FlightRecord | None = None, *, gates: Gates | None = None) -> str:
    """Return the page of a point model: one HTML text that fetches nothing.

    Parameters
    ----------
    model : PointModel
    record : FlightRecord, optional
        That the model was made from: its channels are drawn.
    gates : Gates, optional
        What the scenario asks for; it enters the verdict.

    Returns
    -------
    str
        The same for the same arguments; no time of day enters.

    Raises
    ------
    DataError
        Where the record is not as long as the one that the model was made from.
    """
    provenance = _provenance(model, record)
    if record is not None:
        record = _as_used(model, record)
    return render(
        "report.html",
        title=model.vehicle or "Unnamed vehicle",
        reference=model.reference.id,
        version=__version__,
        findings=verdict(model, gates),
        facts=facts(model, record),
        summary=summary(model, gates),
        data=data_pictures(model, record) if record is not None else [],
        channels=channels(record) if record is not None else [],
        responses=[
            {
                "name": name,
                "symbol": notation.symbol(name, model.form),
                "meaning": notation.meaning(name, model.form),
                "scores": scores(model, name),
                "fits": fit_pictures(model, name),
                "other_fits": [
                    {"number": m + 1, "pictures": fit_pictures(model, name, m)}
                    for m in range(1, maneuvers_of(model))
                ],
                "parameters": parameters(model, name),
                "bars": parameter_picture(model, name),
            }
            for name in model.responses
        ],
        predictions=prediction_pictures(model),
        predicted=model.provenance.get("predicted"),
        collinearity=collinearity_pictures(model),
        differences=difference_table(model),
        sensors=sensor_tables(model),
        level=f"{100 * model.confidence:g}",
        chance=f"{100 * (1 - model.confidence):.2g}",
        provenance=provenance,
    )


def _as_used(model: PointModel, record: FlightRecord) -> FlightRecord:
    """Return the stretch of the record that the model says it was made from."""
    cut = model.provenance.get("cut")
    if isinstance(cut, str) and record.duration > model.duration + record.dt:
        record = record.cut(*parse_span(cut))
    # A correction for delays takes from the ends what not all channels cover; it is drawn as measured.
    shorter = sum(longest_cut(account.errors) for account in sensor_accounts(model).values())
    if not -record.dt <= record.duration - model.duration <= shorter + 3 * record.dt:
        raise DataError(
            f"the record lasts {record.duration:.6g} s, but the model was made from {model.duration:.6g} s",
            remedy="give the record that the model was made from, or none",
        )
    return record


def _provenance(model: PointModel, record: FlightRecord | None) -> dict[str, Any]:
    if record is None or record.provenance in model.provenance.values():
        return model.provenance
    return {**model.provenance, "provenance of the record": record.provenance}

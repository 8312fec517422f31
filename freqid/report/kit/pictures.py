"""The figures of a page: channels and what the data can separate, and the caption that says what to see."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from numpy.typing import NDArray

from freqid.core.channels import GROUPS
from freqid.core.record import FlightRecord
from freqid.core.results.point import PointModel, ResponseModel
from freqid.identify.spectra.fourier import FourierPlan
from freqid.identify.spectra.trend import remove_trend
from freqid.report.kit import figures
from freqid.report.kit.drawing import WIDTH
from freqid.report.kit.figures import Spectrum
from freqid.report.kit.notation import number, plain_symbol, symbol
from freqid.report.kit.svg import inline_svg

_STRIPS = 8  # in one figure at most: about the height of a screen
_GROUP = {
    "state": "States",
    "air": "Air data",
    "effector": "Effector positions",
    "command": "Commands",
    "excitation": "Injected excitation",
    "power": "Power supply",
    "response": "Responses in the record",
}
_HINT = {
    "state": "Look for drift, dropouts and excursions too large for a linear model.",
    "air": "The flight condition should hold: the model is expanded about its mean.",
    "effector": "What moved the aircraft, as measured.",
    "command": "",
    "excitation": "What was added to the commands.",
    "power": "",
    "response": "As the record holds them.",
}
_INDICES = 5  # condition indices shown: the largest tell what the data cannot separate


@dataclass(frozen=True)
class Picture:
    """A figure of the page and what to see in it.

    Attributes
    ----------
    key : str
        Unique in the page: its address there is ``#figure-KEY``.
    svg, caption : Markup
    responses, conditions : tuple of str
        What it shows, as the page writes them; readers filter by these. Empty: it belongs to all.
    wide : bool
        Whether it is wider than a phone's screen at a legible size, and has to be scrolled there.
    """

    key: str
    svg: Markup
    caption: Markup
    responses: tuple[str, ...] = ()
    conditions: tuple[str, ...] = ()
    wide: bool = False


def data_pictures(model: PointModel, record: FlightRecord) -> list[Picture]:
    """Draw the channels of a record by group, and the spectra of its effectors on the model's lines."""
    lines = next((r.fit["frequency"].axis for r in model.responses.values() if "frequency" in r.fit), None)
    pictures = []
    for group in GROUPS:
        names = [n for n in record.channels if n.startswith(group + "/")]
        if group == "command":  # drawn behind the effector's position where there is one
            names = [n for n in names if n.replace("command/", "effector/", 1) not in record]
        for part in _parts(names):
            grey = any(n.replace("effector/", "command/", 1) in record for n in part if group == "effector")
            hint = _HINT[group] if part[0] == names[0] else ""
            pictures.append(
                picture(
                    figures.channel_strips(record, part),
                    f"data{len(pictures)}",
                    f"{_GROUP[group]} over time: {', '.join(part)}",
                    f"{_GROUP[group]}, {_span(part)}. {hint}{' Grey: commands.' if grey else ''}",
                )
            )
        if group == "effector" and lines is not None:
            pictures += [_amplitude_picture(record, part, lines) for part in _parts(names)]
    return pictures


def _amplitude_picture(record: FlightRecord, names: list[str], lines: NDArray[np.float64]) -> Picture:
    plan = FourierPlan(record.time.size, record.dt, lines)
    values = plan(remove_trend(record.matrix(names), record.dt, "line").x)
    units = tuple(record.channel(name).unit for name in names)
    return picture(
        figures.amplitude_strips(Spectrum(tuple(names), units, lines, values, record.duration)),
        f"amplitude{list(record.channels).index(names[0])}",
        f"Amplitudes of the effectors over frequency: {', '.join(names)}",
        f"Amplitudes on the lines of the regression, {_span(names)}. "
        "A response is known where effectors have power.",
    )


def collinearity_pictures(model: PointModel) -> list[dict[str, Any]]:
    """Return what the data can separate, once for all responses on the same regressors.

    Returns
    -------
    list of dict
        ``symbols`` of the responses, their ``inseparable`` groups, the largest condition ``indices`` of
        ``all``, ``rows`` of variance proportions, and ``pictures`` of correlations: one where they agree.
    """
    blocks: dict[tuple[Any, ...], dict[str, Any]] = {}
    maps: dict[tuple[Any, ...], dict[bytes, list[str]]] = {}
    for name, response in model.responses.items():
        key = (response.regressors, np.round(response.condition_index, 6).tobytes())
        correlation = np.round(response.correlation, 6).tobytes()
        maps.setdefault(key, {}).setdefault(correlation, []).append(name)
        weakest = np.argsort(-response.condition_index)[:_INDICES]
        index = response.condition_index[weakest]
        proportion = response.variance_proportion[weakest]
        blocks[key] = {
            "inseparable": response.inseparable,
            "indices": [number(i) for i in index.tolist()],
            "all": response.condition_index.size,
            "rows": [
                (regressor, [(f"{s:.2f}", s > 0.5 and i > 10) for s, i in zip(column, index, strict=True)])
                for regressor, column in zip(response.regressors, proportion.T.tolist(), strict=True)
            ],
        }
    for key, block in blocks.items():
        block["symbols"] = _symbols(model, [name for names in maps[key].values() for name in names])
        block["pictures"] = [_correlation_picture(model, names) for names in maps[key].values()]
    return list(blocks.values())


def _correlation_picture(model: PointModel, names: list[str]) -> Picture:
    response = model[names[0]]
    plain = ", ".join(plain_symbol(name, model.form) for name in names)
    return picture(
        figures.correlation_map(response.regressors, response.correlation),
        f"{key_of(model, names[0])}-correlation",
        f"Correlation of the parameters' errors, {plain}",
        Markup("{}: correlation of the parameters' errors. {}").format(
            _symbols(model, names), _strongest(response)
        ),
        [plain_symbol(name, model.form) for name in names],
    )


def _symbols(model: PointModel, names: list[str]) -> Markup:
    return Markup(", ").join(symbol(name, model.form) for name in names)


def picture(
    figure: Figure,
    key: str,
    label: str,
    caption: Markup | str,
    responses: Iterable[str] = (),
    conditions: Iterable[str] = (),
) -> Picture:
    """Return a figure ready for a page.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    key : str
        Unique in the page.
    label : str
        For those who cannot see it.
    caption : Markup or str
        What to see in it.
    responses, conditions : iterable of str, optional
        What it shows: symbols as `plain_symbol` writes them, and ids of conditions.
    """
    return Picture(
        key,
        inline_svg(figure, key, label),
        Markup("{}").format(caption),
        tuple(responses),
        tuple(conditions),
        figure.get_figwidth() > 1.02 * WIDTH,
    )


def key_of(model: PointModel, name: str) -> str:
    """Return what the ids of a response's figures begin with: its place, for a name may hold anything."""
    return f"r{list(model.responses).index(name)}"


def _parts(names: list[str]) -> list[list[str]]:
    """Split channels into figures of like height, an even number of them where one is not enough."""
    if len(names) <= _STRIPS:
        return [names] if names else []
    count = 2 * -(-len(names) // (2 * _STRIPS))
    bounds = np.linspace(0, len(names), count + 1).round().astype(int)
    return [names[low:high] for low, high in pairwise(bounds)]


def _span(names: list[str]) -> str:
    """Name the channels of a figure by the first and the last."""
    first, last = names[0].partition("/")[2], names[-1].partition("/")[2]
    return first if len(names) == 1 else f"{first} to {last}"


def _strongest(response: ResponseModel) -> Markup:
    if len(response.regressors) < 2:
        return Markup("There is one parameter.")
    apart = np.abs(np.tril(response.correlation, -1))
    i, j = np.unravel_index(int(apart.argmax()), apart.shape)
    return Markup("The strongest is between <code>{}</code> and <code>{}</code>: {}.").format(
        response.regressors[j], response.regressors[i], number(float(response.correlation[i, j]), 2)
    )

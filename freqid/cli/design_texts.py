"""What the short texts behind options of ``freqid design-inputs`` mean."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from freqid.core.errors import UsageError

if TYPE_CHECKING:
    from freqid.core.results.point import PointModel


def wanted_errors(reach: tuple[str, ...], point: PointModel) -> dict[str, dict[str, float]]:
    """Return standard errors by response and regressor from texts such as ``M.de=0.4`` or ``M.de=5%``."""
    wanted: dict[str, dict[str, float]] = {}
    for text in reach:
        parts = re.fullmatch(r"(\w+)\.(\w+)=(\d*\.?\d+(?:[eE][+-]?\d+)?)(%?)", text)
        if parts is None:
            raise UsageError(
                f"found '{text}', expected RESPONSE.REGRESSOR=ERROR",
                where="--reach",
                remedy="write for example M.de1=0.4 or M.de1=5%",
            )
        response, regressor, error, percent = parts.groups()
        estimate = abs(point[response][regressor][0])
        wanted.setdefault(response, {})[regressor] = float(error) * (estimate / 100 if percent else 1.0)
    return wanted


def effector_pair(text: str) -> tuple[str, str]:
    """Return two effectors from a text such as ``de1:dr2``."""
    first, colon, second = text.partition(":")
    if not (first and colon and second):
        raise UsageError(
            f"found '{text}', expected EFFECTOR:EFFECTOR",
            where="--swapped",
            remedy="write for example de1:dr2",
        )
    return first, second

"""What a plausibility check reports: findings, each with its evidence and the setting to change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from freqid.core.errors import DataError

Severity = Literal["error", "warning"]


@dataclass(frozen=True)
class Finding:
    """One thing in a log that cannot be, or hardly can be, what it claims.

    Attributes
    ----------
    severity : {"error", "warning"}
        An error is a contradiction that would spoil what is identified; a warning is worth a look.
    check : str
        Which check found it: ``range``, ``effector``, ``limit``, ``rate limit``, ``spike``, ``stuck``,
        ``latched``, ``unit``, ``sign``, ``swap``, ``axes`` or ``contradiction``.
    channels : tuple of str
        ``group/name`` of each channel concerned.
    message : str
        What was found and what was expected, one sentence without its full stop.
    setting : str
        What to change, without a full stop: a key of the column map or the scenario, or a cut.
    evidence : mapping of str to float or int
        The numbers that the sentence rests on.
    span_s : tuple of 2 floats, optional
        Where in the record, s; all of it where absent.
    """

    severity: Severity
    check: str
    channels: tuple[str, ...]
    message: str
    setting: str
    evidence: Mapping[str, float | int] = field(default_factory=dict)
    span_s: tuple[float, float] | None = None

    def __str__(self) -> str:
        return f"{self.message}; {self.setting}."

    def to_dict(self) -> dict[str, Any]:
        """Return the finding for JSON."""
        found: dict[str, Any] = {
            "severity": self.severity,
            "check": self.check,
            "channels": list(self.channels),
            "message": self.message,
            "setting": self.setting,
            "evidence": {key: _rounded(value) for key, value in self.evidence.items()},
        }
        if self.span_s is not None:
            found["span_s"] = [_rounded(t) for t in self.span_s]
        return found


def _rounded(value: float) -> float | int:
    """Return a number to six digits: evidence is read by people."""
    return value if isinstance(value, int) else float(f"{value:.6g}")


@dataclass(frozen=True)
class PlausibilityReport:
    """All that was found in one log, and what could be looked at.

    Attributes
    ----------
    findings : tuple of Finding
        Errors first.
    agreement : mapping of str to float
        By relation that could be checked, as ``roll angle``: the concordance of what was logged with what
        the other channels imply; 1 where both are the same, 0 where they have nothing in common, -1 where
        the sign is opposite (`freqid.flightlog.plausibility.relations`).
    """

    findings: tuple[Finding, ...] = ()
    agreement: Mapping[str, float] = field(default_factory=dict)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that refuse the log."""
        return tuple(f for f in self.findings if f.severity == "error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that pass."""
        return tuple(f for f in self.findings if f.severity == "warning")

    def to_dict(self) -> dict[str, Any]:
        """Return the report for JSON and for a record's provenance."""
        return {
            "findings": [f.to_dict() for f in self.findings],
            "agreement": {name: round(c, 4) for name, c in self.agreement.items()},
        }

    def refuse(self, where: str) -> None:
        """Raise where there is an error.

        Parameters
        ----------
        where : str
            File of the log.

        Raises
        ------
        DataError
            With a sentence for each error.
        """
        if not self.errors:
            return
        raise DataError(". Also: ".join(str(f)[:-1] for f in self.errors), where=where)


def sentences(findings: Sequence[Finding]) -> list[str]:
    """Return findings as lines for people, each with its severity."""
    return [f"{f.severity}: {f}" for f in findings]

"""The table of effects: ``python -m freqid.simulate.effects.table docs/effects.md`` writes it anew."""

from __future__ import annotations

import sys
from pathlib import Path

from freqid.simulate.effects import shipped
from freqid.simulate.effects.effect import Effect, Parameter

START, STOP = "<!-- effects: written by freqid.simulate.effects.table -->", "<!-- end of effects -->"
KINDS = ("scenario", "callable", "predictions", "fmu", "jsbsim")


def kinds(effect: Effect) -> tuple[str, ...]:
    """Return the kinds of simulation in which an effect can be tested, if its needs are met.

    What acts on signals, logs, mass properties or a whole record can be tested beside any simulation; what
    only adds a wrench inside the flight, in the tilt-wing simulation; what only moves the air, in none.
    """
    if any((effect.distort, effect.load, effect.feel, effect.act, effect.replay)):
        return KINDS
    return KINDS[:1] if effect.add else ()


def effects_table() -> str:
    """Return all effects as two tables in Markdown: what they are, and their parameters."""
    rows = ["| effect | stage | meaning | needs | tested in |", "|---|---|---|---|---|"]
    for identifier, effect in sorted(shipped().items()):
        found = kinds(effect)
        tested = "all" if found == KINDS else ", ".join(found) or "none: flown only"
        needs = " ".join(f"`{need}`" for need in effect.needs)
        rows.append(f"| `{identifier}` | {effect.stage} | {effect.meaning} | {needs} | {tested} |")
    rows += [
        "",
        "| effect | parameter | unit | meaning | usual | scale | range |",
        "|---|---|---|---|---|---|---|",
    ]
    for identifier, effect in sorted(shipped().items()):
        rows += [_row(identifier, name, parameter) for name, parameter in effect.parameters.items()]
    return "\n".join(rows) + "\n"


def _row(identifier: str, name: str, of: Parameter) -> str:
    scale = f"{of.scale:g}" if of.scale else "taken as known"
    span = f"{of.low:g} to {of.high:g}" if max(-of.low, of.high) < float("inf") else "any"
    if span == "any" and of.low > -float("inf"):
        span = f"from {of.low:g}"
    return f"| `{identifier}` | `{name}` | {of.unit} | {of.meaning} | {of.default:g} | {scale} | {span} |"


def renewed(page: str) -> str:
    """Return a page with the table between its markers written anew."""
    before, _, rest = page.partition(START)
    return f"{before}{START}\n\n{effects_table()}\n{STOP}{rest.partition(STOP)[2]}"


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(renewed(path.read_text(encoding="utf-8")), encoding="utf-8")

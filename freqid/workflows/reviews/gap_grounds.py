"""What the diagnosis of a gap says for and against use of the simulation, and for the next flight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from freqid.core.results.diagnosis import Closure, Which
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.review import Ground, Reversal
from freqid.gap.fidelity import ACCEPTABLE

_PHASE_DEG, _GAIN_DB = 45.0, 6.0
MARGINS = (("phase_deg", _PHASE_DEG, "deg"), ("gain_up_db", _GAIN_DB, "dB"))
"""Margins asked of a loop before it is flown: MIL-DTL-9490E and SAE AS94900, rigid-body modes."""
WANTED_G = 0.5
"""Share of a gap that must go with its effect, on flights not used, for use of the corrected simulation."""


def grounds_of_gap(result: GapResult, source: str) -> Iterator[Ground]:
    """Yield what a diagnosis says for and against use of the simulation, and for the next flight.

    Parameters
    ----------
    result : GapResult
    source : str
        Name of its file.
    """
    which, closures = result.which, result.how_far
    chance = Reversal(
        "p if there is no gap",
        result.gap.p,
        result.gap.level,
        source,
        side="at most" if result.gap.exists else "at least",
        weight="good" if result.gap.exists else "stop",
    )
    if not result.gap.exists:
        weight = "risk" if result.gap.unconfirmed else "good"
        yield Ground("simulation", weight, result.verdict.rstrip("."), source, (chance,))
    else:
        named = which.pair or which.named
        closed = closures[0] if closures and named else None
        figures = (chance, *_shares(closures[0])) if closures else (chance,)
        if closed is not None and closed.wrench.G >= WANTED_G and closed.wrench.lo > 0:
            yield Ground("simulation", "risk", _explained(which, named, closed), source, figures)
        else:
            yield Ground("simulation", "stop", result.verdict.rstrip("."), source, figures)
        if not closures:
            text = "how far the gap closes was not tried on any flight"
            yield Ground("simulation", "risk", text, source)
        if closures and closures[0].scored in ("turns", "lines"):
            what = "flights" if closures[0].scored == "turns" else "flight"
            text = (
                f"which effect it is was not tried on a flight that was held out from the diagnosis, only on "
                f"the {what} that it was chosen on (freqid diagnose-gap --holdout)"
            )
            yield Ground("simulation", "risk", text, source)
        if closures:
            yield from _of_own_flight(closures[0], source)
        if closures and (cost := _cost(closures[0])):
            weight = "stop" if _short_margins(closures[0], "after") else "risk"
            yield Ground("next flight", weight, cost, source, tuple(_flown_margins(closures[0])))
    for name, why in which.withdrawn.items():
        yield Ground("simulation", "risk", f"{name} fits best and is withdrawn: {why}", source)
    for group in which.aliases:
        text = f"these flights cannot tell {', '.join(group)} apart"
        yield Ground("simulation", "risk", text, source)
    for fault in result.sensors:
        text = f"the sensors show {fault.fault} in {fault.channel}: {fault.estimate:.3g} {fault.unit}"
        yield Ground("model", "risk", text, source)


def _explained(which: Which, named: Sequence[str], closure: Closure) -> str:
    """Return what explains a gap, in words, and how much of the gap goes with it."""
    from freqid.simulate.effects import library  # loads jax

    meant = [library()[n].signed_meaning(which.changes(n)) for n in named if n in library()]
    words = f" ({'; '.join(m[:1].lower() + m[1:] for m in meant)})" if meant else ""
    g = closure.wrench
    return (
        f"flights and simulation differ, and {' and '.join(named)} explains it{words}: with that change "
        f"{100 * g.G:.0f} % of the difference disappears ({100 * g.lo:.0f} to {100 * g.hi:.0f} %; of its "
        f"energy over noise, the mean included) {closure.scored_text}. Use the simulation with this change "
        "only"
    )


def vehicle_differs(result: GapResult, source: str) -> Iterator[str]:
    """Yield what the named causes of a gap say of mass, inertia and centre of gravity, in sentences.

    Parameters
    ----------
    result : GapResult
    source : str
        Name of its file.
    """
    from freqid.simulate.effects import library  # loads jax

    which = result.which
    known = library()
    for name in (which.pair or which.named) if result.gap.exists else ():
        if name not in known or known[name].stage != "mass":
            continue
        words = known[name].signed_meaning(which.changes(name))
        sizes = [
            f"{n} {s * x.estimate:+.3g} ({s * x.lo:+.3g} to {s * x.hi:+.3g}){f' {unit}' if unit else ''}"
            for n, x in which.parameters.get(name, {}).items()
            for s, unit in [(100.0, "%") if x.unit in ("", "1") else (1.0, x.unit)]
        ]
        yield (
            f"The diagnosis in {source} says otherwise: {words[:1].lower()}{words[1:]}"
            + (f" ({name}: {', '.join(sizes)})" if sizes else f" ({name})")
        )


def _shares(closure: Closure) -> Iterator[Reversal]:
    """Yield the shares of a gap that must go with its effect, where they are known."""
    where = listed(list(map(base_name, closure.held_out)))
    g = closure.wrench
    for text, now, bound in (
        ("Share of the gap that goes with the effect", g.G, WANTED_G),
        ("Lower end of that share's interval", g.lo, 0.0),
    ):
        if math.isfinite(now):
            yield Reversal(text, now, bound, where, side="at least", weight="stop")


def _of_own_flight(closure: Closure, source: str) -> Iterator[Ground]:
    """Yield how the simulation's own flight, with the effect, compares with the record by the cost J."""
    costs = {name: change for name, change in closure.J.items() if math.isfinite(change.after)}
    over = sorted((n for n in costs if costs[n].after > ACCEPTABLE), key=lambda n: -costs[n].after)
    if not costs:
        return
    worst = max(costs, key=lambda n: costs[n].after)
    figure = Reversal(
        "Cost J of the simulation's own flight, with the effect",
        costs[worst].after,
        ACCEPTABLE,
        f"state {worst}",
    )
    names = " and ".join(closure.effects)
    if not over:
        text = (
            f"flown by itself with {names}, the simulation has a cost J of at most {figure.now:.3g} ({worst})"
        )
        yield Ground("simulation", "good", f"{text}; {ACCEPTABLE:g} is acceptable", source, (figure,))
        return
    each = listed([f"{n} ({costs[n].after:.3g}; without it {costs[n].before:.3g})" for n in over])
    text = (
        f"flown by itself with {names}, the simulation is farther from the flights than the cost J of "
        f"{ACCEPTABLE:g} that is acceptable in {each}"
    )
    if math.isfinite(closure.response.G):
        text += f"; {100 * closure.response.G:.0f} % of the difference of its own flight goes with the effect"
    yield Ground("simulation", "risk", text, source, (figure,))


def _cost(closure: Closure) -> str:
    """Return what the effect of a gap does to the margins, in a sentence; empty where no law is known."""
    sentence = str(closure.consequence.get("sentence", "")).rstrip(".")
    least = least_flown(closure)
    if least is None:
        return f"the gap's effect: {sentence}" if sentence else ""
    at, axis, before, after = least
    asked = next(wanted for figure, wanted, _ in MARGINS if figure == "phase_deg")
    where = f"axis {axis} at {at}" if at else f"axis {axis}"
    text = (
        f"with the effect that was found ({' and '.join(closure.effects)}) the control loop keeps "
        f"{after:.1f} deg of phase margin ({where}), {'at least' if after >= asked else 'less than'} the "
        f"{asked:g} deg asked for; the simulation without it has {before:.1f} deg"
    )
    if before < asked:
        text += ", which is too little as well"
    others = [s for s in _short_margins(closure, "after") if "deg" not in s]
    return text + (f"; {listed(others)} asked for, and missed" if others else "")


def least_flown(closure: Closure) -> tuple[str, str, float, float] | None:
    """Return condition and axis of the least phase margin with an effect; the margin without and with it."""
    found = [
        (float(change["after"]), path.split("/")[1], float(change["before"]))
        for path, change in closure.consequence.get("figures", {}).items()
        if path.startswith("margins/") and path.endswith("/phase_deg") and math.isfinite(change["after"])
    ]
    if not found:
        return None
    after, axis, before = min(found)
    return str(closure.consequence.get("reference", "")), axis, before, after


def _short_margins(closure: Closure, when: str) -> list[str]:
    """Return the bounds that margins are below, ``before`` or ``after`` the effect of a gap is added."""
    figures = closure.consequence.get("figures", {})
    return [
        f"{wanted:g} {unit} is"
        for figure, wanted, unit in MARGINS
        if any(
            path.startswith("margins/") and path.endswith(f"/{figure}") and change.get(when, wanted) < wanted
            for path, change in figures.items()
        )
    ]


def _flown_margins(closure: Closure) -> Iterator[Reversal]:
    """Yield the least margins with the effect of a gap."""
    at = str(closure.consequence.get("reference", ""))
    for figure, wanted, unit in MARGINS:
        least = min(
            (
                (float(change["after"]), path.split("/")[1])
                for path, change in closure.consequence.get("figures", {}).items()
                if path.startswith("margins/")
                and path.endswith(f"/{figure}")
                and math.isfinite(change["after"])
            ),
            default=None,
        )
        if least is not None:
            yield Reversal(
                f"Least {figure.split('_')[0]} margin with the effect ({' and '.join(closure.effects)})",
                least[0],
                wanted,
                f"{least[1]} at {at}" if at else least[1],
                unit,
                side="at least",
                weight="stop",
            )


def listed(names: Sequence[str]) -> str:
    """Join names as a sentence does: a, b and c."""
    return " and ".join(n for n in (", ".join(names[:-1]), *names[-1:]) if n)


def base_name(record: str) -> str:
    """Return the name of a file without its folder."""
    return record.rpartition("/")[2]

"""Tolerances, offsets and effects made straight about where they came out together, not about nominal.

Columns say what each makes alone. What many of them make together is not their sum: a rotor's offset is felt
through a propeller that has five per cent more thrust, and a slipstream that is missing changes what a flap's
size makes. On an aircraft of two hundred uncertain parameters, flown slowly, that is fifty standard
deviations of a mean moment. So the simulation is asked once with all of them at their likeliest sizes, and
what their columns say less than that is taken off the residual (Gauss-Newton with columns that stay: G. A. F.
Seber, C. J. Wild, Nonlinear Regression, 1989, section 2.1). A step to where the data are less likely, asked
there and not by the lines, is shortened to where a parabola through what was found has its least (J. E.
Dennis, R. B. Schnabel, Numerical Methods for Unconstrained Optimization, 1983, section 6.3.2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError, ImpossibleSettings
from freqid.gap.infer.at_form import Kept
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns
from freqid.gap.infer.evidence import Evidence, weigh, weights_of
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.system import About, System
from freqid.gap.infer.together import Acting, Point
from freqid.gap.model import varying_parameters
from freqid.gap.model.candidate import OTHER, Candidate
from freqid.gap.model.candidates import recomputed
from freqid.gap.model.tolerance import own_departures, record_columns, tolerance_columns
from freqid.gap.settings import FARTHEST, MOST_ROUNDS, SETTLED
from freqid.gap.simulation import side_by_side
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect

Made = TypeVar("Made")

_TRIES = 3  # of a step, shorter each time where the data are less likely at its end
_SHORTER = (0.1, 0.5)  # least and largest share of such a step that is tried next (the book's bounds)


@dataclass(frozen=True, eq=False)
class Linearised:
    """The model of the data as straight lines about one place of all that is unknown.

    In its methods `acting` are effects with their sizes, `fitted` the departures of all tolerances in sigmas,
    shape (tolerance,), and `form_error` that at which departures, and the records' own unknowns, are fitted.

    Attributes
    ----------
    system : System
        The lines in small matrices, and where they were made straight.
    columns : list of Columns
        By block.
    blocks : list of Block
        As the columns are drawn.
    effects : dict of Effect
        By id, with the parameters that they have on the vehicle.
    sizes : dict of float
        Tolerances, one sigma by name.
    """

    system: System
    columns: list[Columns]
    blocks: list[Block]
    effects: Mapping[str, Effect]
    sizes: Mapping[str, float]

    @cached_property
    def evidence(self) -> Evidence:
        """What the data say of every candidate."""
        return weigh(self.system)

    def rebuilt(self, candidates: list[Candidate]) -> Linearised:
        """Return the model with other columns of some candidates, in the same order; all else as it was."""
        system, new = self.system, []
        for b, (old, block) in enumerate(zip(self.columns, self.blocks, strict=True)):
            parts = [
                system.columns_of(i) if c is system.candidates[i] else block.white(c.columns[b])
                for i, c in enumerate(candidates)
            ]
            new.append(old.with_effects(parts))
        made = replace(system, candidates=candidates, blocks=[c.matrices for c in new], _kept=Kept())
        return replace(self, system=made, columns=new)

    def redrawn(self, places: Sequence[int], *, first_order: bool = False) -> Linearised:
        """Return the model in which some candidates have the columns of blocks as these are drawn.

        Of the simulation's own parameters these are the slopes of their tolerances. `first_order` as in
        `change`: enough to weigh effects, of which those that lead are replayed in full.
        """
        new, names = list(self.system.candidates), self.system.tolerances
        for i in places:
            c = new[i]
            if c.effect == OTHER and c.kind == "scalar":
                k = names.index(c.place.label)
                made = [b.sigmas[k : k + 1] for b in self.columns]
            else:
                made = recomputed(c, self.effects, self.blocks, first_order=first_order)
            new[i] = replace(c, columns=made)
        return self.rebuilt(new) if places else self

    def all_redrawn(self) -> Linearised:
        """Return the model in which all candidates have the columns of blocks as these are drawn."""
        lead = _leading(self.evidence)
        others = [i for i in range(len(self.system.candidates)) if i not in lead]
        return self.redrawn(others, first_order=True).redrawn(lead)

    def without_effects(self) -> Linearised:
        """Return the model with no candidates."""
        s, parts = self.system, [replace(c, effects=c.effects[:0]) for c in self.columns]
        system = System([], s.tolerances, [c.matrices for c in parts], s.form_errors)
        return replace(self, system=system, columns=parts)

    def at(self, fitted: Array, acting: Acting, form_error: Form, *, anew: bool = False) -> Linearised:
        """Return lines that are right where tolerances and effects have some sizes.

        The residual is less by what all make together beyond their columns. With `anew`, tolerances and the
        records' own unknowns also have the slopes of the blocks as they are drawn.
        """

        def there(pair: tuple[Columns, Block]) -> Columns:
            return self._straightened(*pair, fitted, acting, form_error, anew)

        new = self._by_block(there)
        blocks = [c.matrices for c in new]
        system = self.system
        system = replace(system, blocks=blocks, _kept=Kept()) if anew else system.with_data(blocks)
        acting = [(i, replace(e, candidate=system.candidates[i])) for i, e in acting]  # as it is drawn now
        about = About(fitted, acting, form_error, _misfit(system, form_error, fitted, acting))
        return replace(self, system=replace(system, about=about), columns=new)

    def likelier(self, form_error: Form, acting: Acting | None = None) -> Linearised:
        """Return lines that are right where all that is unknown is likeliest, by one step.

        Where the data are less likely there than where lines were made straight before, another effect that
        leads is not taken, and a step is shortened. Where the slope at its beginning promises less than
        `SETTLED` nats, no step is taken, and lines stay as they are. Without `acting`, the likeliest effect
        acts beside the tolerances, if one is likely.
        """
        free, here = acting is None, self

        def fit(acting: Acting) -> Array:
            """Return the likeliest tolerances beside effects; sizes have those of their parameters."""
            system = here.system
            own = system.own_tolerances(i for i, _ in acting)
            return system.likeliest_tolerances(form_error, weights_of(system, acting), own)

        def asked(fitted: Array, acting: Acting) -> tuple[float, Linearised | None]:
            """Return how unlikely the data are there, and lines that are right there."""
            try:
                with np.errstate(over="ignore", invalid="ignore"):  # loads of 1e187 N: no such step is taken
                    found = here.at(fitted, acting, form_error)
            except DataError:  # no simulation can be so
                return np.inf, None
            assert found.system.about is not None
            misfit = found.system.about.misfit
            return (misfit, found) if np.isfinite(misfit) else (np.inf, None)

        about = self.system.about
        known, acted, least, found = np.zeros(len(self.system.tolerances)), None, np.inf, None
        if about is not None:
            known, acted = about.tolerances, about.acting
            if all(e.candidate is self.system.candidates[i] for i, e in acted):
                least, found = _misfit(self.system, form_error, known, acted), self
            else:  # columns of what acts were drawn anew since: lines are not right there any more
                least, found = asked(known, acted)
                here = found or self
        if acting is None:
            acting = _likeliest_alone(_weighed(here.system, form_error))
        if acted is None:
            acted = acting
        fitted = fit(acting)
        if not _same(acted, acting):
            misfit, there = asked(fitted, acting)
            if there is not None and not (free and misfit > least + SETTLED):
                return there
            places = [i for i, _ in acted]
            acting = list(zip(places, joint_estimates(here.system, places), strict=True))
            fitted = fit(acting)
        gain, share = least - _misfit(here.system, form_error, fitted, acting), 1.0
        for _ in range(_TRIES):
            if 2 * share * gain < SETTLED:
                break
            misfit, there = asked(known + share * (fitted - known), _part_of_the_way(acted, acting, share))
            if misfit < least:
                found = there
                break
            bend = misfit - least + 2 * share * gain
            share *= float(np.clip(share * gain / bend, *_SHORTER)) if np.isfinite(bend) else _SHORTER[0]
        return found or here.at(fitted, acting, form_error)

    def drawn(self, fitted: Array, acting: Acting, form_error: Form) -> list[Block]:
        """Return the blocks as they are drawn where tolerances, offsets and effects have some sizes."""

        def there(pair: tuple[Columns, Block]) -> Block:
            return replace(pair[1], as_moved=self._point(*pair, fitted, acting, form_error).moved(pair[1]))

        return self._by_block(there)

    def drawn_anew(self, *, leading: bool = False) -> Linearised:
        """Return lines that also have the slopes that they have where they were made straight.

        With `leading`, so have the effects that lead: one bias as an effect and as a tolerance, each on other
        motion, would leave a change between the two that nothing makes.
        """
        assert self.system.about is not None
        fitted, acting, form_error, _ = self.system.about
        there = replace(self, blocks=self.drawn(fitted, acting, form_error))
        if leading:
            there = there.redrawn(_leading(_weighed(self.system, form_error)))
        return there.at(fitted, acting, form_error, anew=True)

    def settled(self, form_error: Form, acting: Acting | None = None) -> Linearised:
        """Return lines that are drawn anew until the data are no likelier by another round; as in `likelier`.

        Two explanations are compared where both have settled, for each round may gain as much as an effect
        does. What all make together is asked for first with slopes that stay, which is quick; where that
        changes nothing, slopes of the same place would not either (the chord method: J. M. Ortega, W. C.
        Rheinboldt, Iterative Solution of Nonlinear Equations in Several Variables, 1970, section 7.1).
        """
        free, at = acting is None, self
        if free:  # those that lead now may not have led when lines were drawn
            at = at.redrawn(_leading(_weighed(at.system, form_error)))
        before = at._log_evidence(form_error, acting)
        for _ in range(MOST_ROUNDS):
            start = before
            for _ in range(MOST_ROUNDS):
                last = at.system.about
                at = at.likelier(form_error, acting)
                here = at.system.about
                assert here is not None
                if last and _same(last.acting, here.acting) and here.misfit > last.misfit - SETTLED:
                    break
            before = at._log_evidence(form_error, acting)
            if abs(before - start) < SETTLED:
                break
            at = at.drawn_anew(leading=free)
            before = at._log_evidence(form_error, acting)
        return at

    def settled_beside_none(self, form_error: Form) -> tuple[Linearised, float]:
        """Return what `settled` returns, and the nats by which no effect is likelier than these lines say.

        They are right where tolerances are likeliest *beside* the likeliest effect. Where that effect and a
        tolerance do the same, as a late channel does, they are elsewhere without it: the case of no effect
        would be judged with the errors of lines drawn far from it. So it is judged with lines of its own.
        Where no effect is likelier than that one even so, the search begins again from there: it may have
        settled about an effect that does much the same, as all other channels early in place of one late.
        An effect that lines were drawn about before, and that another one replaced, is settled too: on
        the other's lines it is judged as no effect would be.
        """
        at, about = self.settled(form_error), self.system.about
        if not _likeliest_alone(_weighed(at.system, form_error)):
            return at, 0.0
        assert at.system.about is not None
        if about and about.acting and not _same(about.acting, at.system.about.acting):
            at = _likelier_of(at, self.settled(form_error, about.acting), form_error)
        alone = at.without_effects().settled(form_error, [])
        assert alone.system.about is not None
        if _weighed(alone.system, form_error).log_none > _with_likeliest(at.system, form_error):
            again = at.at(alone.system.about.tolerances, [], form_error).settled(form_error)
            at = _likelier_of(at, again, form_error)
        return at, max(alone.evidence.log_none - at.without_effects().evidence.log_none, 0.0)

    def among_likeliest(self, form_error: Form) -> Linearised:
        """Return lines about whichever of the leading effects is likeliest, each where it has settled itself.

        Lag and delay of an actuator do much the same, and lines about one favour it.
        """
        assert self.system.about is not None
        acting, best = [i for i, _ in self.system.about.acting], self
        for i in self.evidence.likeliest:
            if i not in acting:
                one = self.settled(form_error, [(i, joint_estimates(self.system, [i])[0])])
                best = _likelier_of(best, one, form_error)
        return best

    def likeliest_departures(
        self, form_error: Form, weights: Array | None = None
    ) -> tuple[dict[str, float], Array]:
        """Return the likeliest departures of the simulation's own parameters, and of all in sigmas.

        Of the first none beyond `FARTHEST`: where a large effect is not allowed for, tolerances are asked for
        what no simulation can do. `weights` are those of candidates' columns, shape (column,); of the
        likeliest effect where absent.
        """
        own = own_departures(self.blocks[0].trial, self.sizes)
        system = replace(self.system, form_errors=(form_error,))
        beside = weights_of(system, _likeliest_alone(weigh(system))) if weights is None else weights
        fitted = system.likeliest_tolerances(form_error, beside)
        found: dict[str, float] = {}
        for key, x in zip(system.tolerances, np.clip(fitted, -FARTHEST, FARTHEST).tolist(), strict=True):
            for name, sigma in own.get(key, {}).items():
                found[name] = found.get(name, 0.0) + x * sigma
        return found, fitted

    def _by_block(self, work: Callable[[tuple[Columns, Block]], Made]) -> list[Made]:
        """Return what some work makes of each block and its columns."""
        pairs = list(zip(self.columns, self.blocks, strict=True))
        return side_by_side(self.blocks[0].trial.simulation, work, pairs)

    def _point(
        self,
        columns: Columns,
        block: Block,
        fitted: Array,
        acting: Acting,
        form_error: Form,
        *,
        bodies: bool = True,
    ) -> Point:
        return Point.about(
            columns, block, self.system, fitted, acting, self.effects, self.sizes, form_error, bodies=bodies
        )

    def _straightened(
        self, columns: Columns, block: Block, fitted: Array, acting: Acting, form_error: Form, anew: bool
    ) -> Columns:
        """Return the columns of a block, its residual less what all make together beyond their columns."""
        c, system = columns, self.system
        point = self._point(c, block, fitted, acting, form_error)
        try:
            whole = point.made(block)
        except ImpossibleSettings:  # a fit asks for a body that cannot be: its mass properties stay straight
            point = self._point(c, block, fitted, acting, form_error, bodies=False)
            whole = point.made(block)
        if anew:
            c = self._sloped(c, block)
        straight = np.zeros_like(c.residual)
        for names, made in ((system.tolerances, c.tolerances), (c.own_names, c.own)):
            straight += np.array([point.sigmas.get(n, 0.0) for n in names]) @ made
        straight += weights_of(system, point.acting) @ c.effects
        return c.with_residual(block.white(block.residual - whole) + straight)

    def _sloped(self, columns: Columns, block: Block) -> Columns:
        """Return columns of which tolerances and the record's own unknowns have the slopes of a block."""
        c, names, z = columns, self.system.tolerances, np.zeros_like(block.residual)
        stated, unknown = (of(block, self.effects, self.sizes) for of in (tolerance_columns, record_columns))
        sigmas = np.array([stated.get(n, z) for n in names]) if names else c.sigmas
        own = np.array([unknown.get(n, z) for n in c.own_names]) if c.own_names else c.sigmas[:0]
        stay = np.array([n.startswith(varying_parameters.NAME) for n in c.own_names], dtype=bool)[:, None]
        return c.with_slopes(sigmas, block.white(sigmas), np.where(stay, c.own, block.white(own)))

    def _log_evidence(self, form_error: Form, acting: Acting | None) -> float:
        """Return the log evidence of what acts; of the likeliest effect where absent."""
        system = replace(self.system, form_errors=(form_error,))
        acting = _likeliest_alone(weigh(system)) if acting is None else acting
        reduced, w = system.reduced(form_error), weights_of(system, acting)
        return reduced.log_evidence + float(w @ reduced.g - 0.5 * w @ reduced.G @ w)


def _weighed(system: System, form_error: Form) -> Evidence:
    """Return what the data say of every candidate at one error of form."""
    return weigh(replace(system, form_errors=(form_error,)))


def _with_likeliest(system: System, form_error: Form) -> float:
    """Return the log evidence of the likeliest effect, wherever it acts, at one error of form."""
    evidence = _weighed(system, form_error)
    return float(evidence.log_none + max(evidence.effect.values()))


def _likelier_of(one: Linearised, other: Linearised, form_error: Form) -> Linearised:
    """Return the lines on which their likeliest effect is likelier."""
    return max((one, other), key=lambda at: _with_likeliest(at.system, form_error))


def _misfit(system: System, form_error: Form, tolerances: Array, acting: Acting) -> float:
    """Return how unlikely data and tolerances are where some effects act."""
    return system.misfit(form_error, tolerances, weights_of(system, acting))


def _same(before: Acting, after: Acting) -> bool:
    """Return whether the same candidates act, whatever their sizes."""
    return [i for i, _ in before] == [i for i, _ in after]


def _part_of_the_way(before: Acting, after: Acting, share: float) -> Acting:
    """Return effects a share of the way from the sizes that they had."""
    sizes = {i: e.size for i, e in before}
    return [(i, replace(e, size=sizes[i] + share * (e.size - sizes[i]))) for i, e in after]


def _leading(evidence: Evidence) -> list[int]:
    """Return the places of the effects that lead where these are likelier than no effect."""
    candidates = evidence.system.candidates
    lead = {candidates[i].effect for i in evidence.likeliest}
    return [i for i in np.flatnonzero(evidence.candidate > 0).tolist() if candidates[i].effect in lead]


def _likeliest_alone(evidence: Evidence) -> Acting:
    """Return the likeliest effect with its size, that of a tolerance among it; none where none is likely."""
    best = int(np.argmax(evidence.candidate)) if len(evidence.candidate) else -1
    if best < 0 or evidence.candidate[best] <= 0:
        return []
    return [(best, joint_estimates(evidence.system, [best])[0])]

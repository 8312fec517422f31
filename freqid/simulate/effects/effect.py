"""What a physical effect declares, so that it can be switched, scaled, differentiated and diagnosed."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, Literal

from freqid.core.vehicle import Vehicle

Stage = Literal["command", "airframe", "mass", "sensor", "environment"]


@dataclass(frozen=True)
class Parameter:
    """A number that an effect can be set by.

    Attributes
    ----------
    default : float
        Where the scenario is silent.
    unit : str
        SI, ``"1"`` for a pure number.
    meaning : str
        A phrase.
    scale : float
        A change that would be plausible and would matter: one sigma of what is expected before any data,
        and the step by which differences are taken. Zero for a number that is taken as known.
    low, high : float
        What the parameter may be.
    looked_at : tuple of float
        Of one that says nothing while the effect's size is zero: values beside the default at which the size
        is looked for; two scales to either side where none are named.
    follows : bool
        Whether it is the time that the described actuators take to follow their commands: where a simulation
        has these, it is looked at there instead.
    sought : bool
        Whether it is looked for; else it may be off within its tolerance and no more.
    replay_only : bool
        Whether flights of a scenario do not have it: these have more of the physics that it stands for.
    signs : tuple of 2 str
        What is so where a simulation's number has to be raised, and where it has to be lowered: two
        sentences without a full stop; empty where only one sign is physical.
    """

    default: float
    unit: str
    meaning: str
    scale: float = 1.0
    low: float = -inf
    high: float = inf
    looked_at: tuple[float, ...] = ()
    follows: bool = False
    sought: bool = True
    replay_only: bool = False
    signs: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class Effect:
    """One physical effect; its file in this folder, or a user's own, holds one of these as ``EFFECT``.

    Whatever it does it does through the hooks below, and the same hooks serve flight, replay and fitting.
    An effect without any acts inside the simulation's physics, where its settings are read, and can be
    tested in simulations that have it.

    Attributes
    ----------
    id : str
        Also the file's name.
    stage : {"command", "airframe", "mass", "sensor", "environment"}
        Where in the flight it acts.
    meaning : str
        A sentence.
    parameters : dict of Parameter
        By name. The first one is the effect's size: at zero the effect is absent. Others at their
        defaults add nothing.
    needs : tuple of str
        Without which it cannot be computed: ``vehicle.<field>``, ``wing``, ``rotor``, ``surface`` (at least
        one of them in the vehicle; ``wing or surface``: one of either), channels of the record as
        ``group/name`` or any of a ``group``, sections of ``[simulation]``. What is altogether missing leaves
        an effect untested.
    states : dict of str
        Unit by name of the memory that a flight keeps for it and that no prediction of loads at one instant
        sees: such an effect is always replayed over whole records.
    alternatives : bool
        Whether the parameters are places of which one is expected at fault, rather than numbers that are
        all free together.
    jointly : tuple of str
        Of such places those that may be at fault at once, each in its own way, as all kinds of effector.
    together : bool
        Whether the parameters are off together only: each by itself is another effect.
    sizes : tuple of float
        Of an effect that does nothing below some size, such as a limit: sizes at which it is looked for.
    in_loop : bool
        Whether it acts before or inside an actuator's loop, where `act` behind it only comes near: what
        reaches a motor late is turned into speed by the voltage of that moment. A simulation that has the
        effect itself is asked.
    add : callable, optional
        ``add(settings, situation) -> Wrench`` of an airframe effect that comes on top of the airframe's
        loads at one instant, in jax.numpy; `situation` is an `airframe.Situation`, with the effect's memory.
    start : callable, optional
        ``start(settings, situation) -> dict``: the memory, by state, of a vehicle that has been doing for
        long what it does now.
    rate : callable, optional
        ``rate(settings, situation) -> dict``: the rate of change of the memory.
    replay : callable, optional
        ``replay(settings, replay) -> ndarray (6, sample)``: what the effect adds to X Y Z L M N (moments
        about the centre of gravity) over a whole record, numpy; `replay` is a
        `freqid.gap.model.replay.Replay`. For simulations that know nothing of the effect.
    act : callable, optional
        ``act(settings, signals, dt, kinds) -> signals`` of a command effect: positions of effectors by name,
        shape (sample,), as the effect makes them of positions without it; `kinds` by effector name.
    feel : callable, optional
        ``feel(settings, signals, dt, kinds) -> signals``: like `act`, but of what lies between the measured
        position and the airframe: positions that the airframe feels, of positions as they are measured. A
        surface that has lost effectiveness, backlash behind the servo, a weak propeller.
    departs : callable, optional
        ``departs(settings) -> dict of float``: the same effect as relative departures of a simulation's own
        parameters, by name, as ``{"n1.thrust": -0.2}``. Where a simulation declares a single one, effect and
        tolerance have one size. It takes the place of `feel` where all are declared: what a simulation says
        of a rotor's thrust is nearer to a weak rotor than another speed.
    distort : callable, optional
        ``distort(settings, record) -> record`` of a sensor or environment effect: the log that the effect
        makes of a log without it.
    inverse : callable, optional
        ``inverse(size) -> size`` of `distort`: the size that takes a distortion of a size back; minus the
        size where none is given.
    load : callable, optional
        ``load(settings, vehicle) -> Vehicle`` of a mass effect: the vehicle with it.
    for_vehicle : callable, optional
        ``for_vehicle(vehicle) -> dict of Parameter``: parameters beyond those above, for each rotor by its
        name for one, or the same ones with another scale.
    """

    id: str
    stage: Stage
    meaning: str
    parameters: dict[str, Parameter]
    needs: tuple[str, ...] = ()
    states: dict[str, str] = field(default_factory=dict)
    alternatives: bool = False
    jointly: tuple[str, ...] = ()
    together: bool = False
    sizes: tuple[float, ...] = ()
    in_loop: bool = False
    add: Callable[[dict[str, Any], Any], Any] | None = None
    start: Callable[[dict[str, Any], Any], dict[str, Any]] | None = None
    rate: Callable[[dict[str, Any], Any], dict[str, Any]] | None = None
    replay: Callable[[dict[str, float], Any], Any] | None = None
    act: Callable[[dict[str, float], dict[str, Any], float, dict[str, str]], dict[str, Any]] | None = None
    feel: Callable[[dict[str, float], dict[str, Any], float, dict[str, str]], dict[str, Any]] | None = None
    departs: Callable[[dict[str, float]], dict[str, float]] | None = None
    distort: Callable[[dict[str, float], Any], Any] | None = None
    inverse: Callable[[float], float] = operator.neg
    load: Callable[[dict[str, float], Any], Any] | None = None
    for_vehicle: Callable[[Vehicle], dict[str, Parameter]] | None = None

    @property
    def size(self) -> str:
        """Name of the parameter that switches and scales the effect."""
        return next(iter(self.parameters))

    def signed_meaning(self, changes: Mapping[str, tuple[float, float]]) -> str:
        """Return what the effect means, without a full stop, by the signs that are known of its changes.

        Parameters
        ----------
        changes : mapping of str to (float, float)
            Ends of the interval of each parameter's change; a place where it acts, such as an effector, has
            the words of the effect's size. An interval that holds zero, or is a point, says nothing.

        Returns
        -------
        str
            `meaning` where no interval says more.
        """
        words = []
        for name, (low, high) in changes.items():
            signs = self.parameters.get(name, self.parameters[self.size]).signs
            if low < high and (low > 0 or high < 0) and any(signs):
                words.append(signs[0] if low > 0 else signs[1])
        return "; ".join(dict.fromkeys(words)) or self.meaning.rstrip(".")

    def of(self, vehicle: Vehicle | None) -> Effect:
        """Return the effect with the parameters that it has on a vehicle.

        A size at one effector means there what the effect's size means everywhere.
        """
        if vehicle is None or self.for_vehicle is None:
            return self
        signs = self.parameters[self.size].signs if self.alternatives else ("", "")
        own = {
            n: p if any(p.signs) else replace(p, signs=signs) for n, p in self.for_vehicle(vehicle).items()
        }
        return replace(self, parameters={**self.parameters, **own})

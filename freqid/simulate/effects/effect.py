"""What a physical effect declares, so that it can be switched, scaled, differentiated and diagnosed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal


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
    """

    default: float
    unit: str
    meaning: str


@dataclass(frozen=True)
class Effect:
    """One physical effect; its file in this folder holds one of these as ``EFFECT``.

    Attributes
    ----------
    id : str
        Also the file's name.
    stage : {"command", "airframe", "sensor", "environment"}
        Where in the flight it acts.
    meaning : str
        A sentence.
    parameters : dict of Parameter
        By name. The first one is the effect's size: at zero the effect is absent.
    needs : tuple of str
        Fields of the vehicle or sections of ``[simulation]`` without which it cannot be computed.
    states : dict of str
        Unit by name of the memory that the flight's scan keeps for it.
    add : callable, optional
        ``add(settings, situation) -> Wrench`` of an airframe effect that comes on top of the airframe's
        loads; `situation` is an `airframe.Situation`. Effects that act inside the physics have none.
    """

    id: str
    stage: Literal["command", "airframe", "sensor", "environment"]
    meaning: str
    parameters: dict[str, Parameter]
    needs: tuple[str, ...] = ()
    states: dict[str, str] = field(default_factory=dict)
    add: Callable[[dict[str, Any], Any], Any] | None = None

    @property
    def size(self) -> str:
        """Name of the parameter that switches and scales the effect."""
        return next(iter(self.parameters))

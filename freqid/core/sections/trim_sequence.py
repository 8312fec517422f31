"""Section ``[campaign]``: one long flight through many trims, with a manoeuvre at each."""

from __future__ import annotations

from math import inf
from typing import Literal

from freqid.core.vehicle import Strict

LONGEST_S = 3600.0  # that a trim is flown without excitation: no battery lasts longer
STEEPEST = 1.0  # rad; beyond it airspeed and climb angle say nothing to a controller of energy


class CampaignTrim(Strict, frozen=True):
    """One ``[[campaign.trim]]``.

    Attributes
    ----------
    speed : float
        Airspeed, m/s.
    climb_rad : float
        Flight path angle, positive up; with stopped rotors the one that is expected, as the glide finds its
        own.
    rotors : {"running", "stopped"}
    """

    speed: float
    climb_rad: float = 0.0
    rotors: Literal["running", "stopped"] = "running"

    def __post_init__(self) -> None:
        if not 0 < self.speed < inf:
            raise ValueError(f"speed is {self.speed:g}, expected a positive airspeed")
        if not abs(self.climb_rad) <= STEEPEST:
            raise ValueError(f"climb_rad is {self.climb_rad:g}, expected at most {STEEPEST:g} either way")


class Campaign(Strict, frozen=True):
    """Section ``[campaign]``.

    Attributes
    ----------
    trim : tuple of CampaignTrim
        In the order flown; at each one the multisines of ``[excitation]`` are flown, at a held advance ratio.
    start : str
        Reference condition that the flight starts from, in level trim; the first one where absent.
    settle_s : float
        From the command of a trim to its excitation.
    rest_s : float
        Trim that is held after an excitation.
    altitude_m : float
        Above ground, at the start.
    """

    trim: tuple[CampaignTrim, ...]
    start: str = ""
    settle_s: float = 15.0
    rest_s: float = 6.0
    altitude_m: float = 100.0

    def __post_init__(self) -> None:
        if not self.trim:
            raise ValueError("the campaign has no trim, expected [[campaign.trim]] entries")
        for name in ("settle_s", "rest_s", "altitude_m"):
            if not 0 < getattr(self, name) < inf:
                raise ValueError(f"{name} is {getattr(self, name):g}, expected a positive number")
        for name in ("settle_s", "rest_s"):
            if getattr(self, name) > LONGEST_S:
                raise ValueError(f"{name} is {getattr(self, name):g}, expected at most {LONGEST_S:g} s")

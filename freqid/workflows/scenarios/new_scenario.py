"""A list of effectors, or the channels of a log, becomes a commented scenario to be filled in."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from freqid.core.channels import EFFECTOR_UNITS, TAKEN
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import read_record
from freqid.core.scenario import FILL_IN
from freqid.core.store import replacing
from freqid.flightlog.listing import list_log
from freqid.flightlog.names import guess_kind
from freqid.workflows.inputs import File

# Limits, rate and amplitude that a skeleton starts from, by kind: to be replaced.
_START = {
    "surface": ([-0.5, 0.5], 5.0, 0.06),
    "tilt": ([-0.1, 1.7], 0.5, 0.03),
    "rotor": ([0.0, 900.0], 4000.0, 15.0),
    "thrust": ([0.0, 100.0], 200.0, 3.0),
    "throttle": ([0.0, 1.0], 4.0, 0.04),
}


def new_scenario(effectors: Iterable[str] = (), *, log: File | None = None, name: str = "My aircraft") -> str:
    """Return the text of a scenario that can be read as it is and says what has to be filled in.

    Parameters
    ----------
    effectors : iterable of str
        Names, ``"de1"``, or names with their kind, ``"left:tilt"``.
    log : path, optional
        A record of freqid, or a log of another tool: the effectors that `list_log` proposes are added.
    name : str
        Of the aircraft.

    Returns
    -------
    str
        TOML, with comments that mark each placeholder.

    Raises
    ------
    UsageError
        Where a name tells no kind and none is given, or nothing is left to describe.
    DataError
        Where the log cannot be read.

    Examples
    --------
    >>> print(new_scenario(["de", "left:tilt", "n1"]).splitlines()[0])
    # My aircraft: 1 rotor, 1 surface, 1 tilt. SI units and radians throughout.
    """
    kinds = _of_log(Path(log)) if log is not None else {}
    named = [text.partition(":") for text in effectors]
    kinds |= _kinds({name.strip(): kind.strip() for name, _, kind in named})
    if not kinds:
        raise UsageError(
            "no effector is named" + (f" by the columns of {log}" if log else ""),
            remedy="name them with --effectors, such as --effectors de1,de2,n1:rotor",
        )
    for taken in kinds:
        if taken in TAKEN or "/" in taken or not taken:
            raise UsageError(
                f"effector '{taken}' has the name of a state, of air data or of nothing", remedy="rename it"
            )
        if not re.fullmatch(r"[\w.+-]+", taken):
            raise UsageError(
                f"effector '{taken}' has a name with other signs than letters, digits and _ . + -",
                remedy="rename it",
            )
    return _text(kinds, name)


def write_scenario(path: Path, text: str) -> None:
    """Write the text of a scenario, whole or not at all; a file that is there is never replaced.

    Raises
    ------
    UsageError
        Where the file is there.
    DataError
        Where the folder cannot be written.
    """
    if path.exists():
        raise UsageError("is there already", where=str(path), remedy="choose another name with -o")
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def _kinds(given: Mapping[str, str]) -> dict[str, str]:
    """Return kind by name; those that tell none are refused together."""
    for name, kind in given.items():
        if kind and kind not in EFFECTOR_UNITS:
            raise UsageError(f"effector '{name}' is of kind '{kind}'", remedy=nearest(kind, EFFECTOR_UNITS))
    kinds = {name: kind or guess_kind(name) for name, kind in given.items()}
    if unknown := [name for name, kind in kinds.items() if not kind]:
        named = ", ".join(f"'{name}'" for name in unknown)
        verb = "the names {} do" if len(unknown) > 1 else "the name {} does"
        raise UsageError(
            f"{verb.format(named)} not tell what kind of effector it is",
            remedy=f"write each with its kind, as {unknown[0]}:KIND; kinds are {', '.join(EFFECTOR_UNITS)}",
        )
    return kinds


def _of_log(path: Path) -> dict[str, str]:
    """Return kind by effector of a record, or of the column map that is proposed for a log."""
    if path.suffix == ".h5":
        record = read_record(path)
        units = {name: record.channel(f"effector/{name}").unit for name in record.group("effector")}
        return {name: _kind_of(name, unit) for name, unit in units.items()}
    listing = list_log(path)
    logged, proposed = {c.name for c in listing.channels}, tomllib.loads(listing.map)
    found = {
        place["name"].removeprefix("effector/"): place["unit"]
        for place in proposed.get("channel", ())
        if place["name"].startswith("effector/") and logged & {place.get("column"), place.get("variable")}
    }
    found |= {
        rotor["name"]: "rad/s"
        for rotor in proposed.get("rotor", ())
        if logged & {rotor.get("telemetry"), rotor.get("command")}
    }
    return {name: _kind_of(name, unit) for name, unit in found.items()}


def _kind_of(name: str, unit: str) -> str:
    """Return the kind of effector of a logged position: by its unit, where that tells, else by its name."""
    by_unit = {"rad/s": "rotor", "rpm": "rotor", "N": "thrust"}
    return by_unit.get(unit) or guess_kind(name) or "surface"


def _text(kinds: Mapping[str, str], name: str) -> str:
    by_kind = {kind: [n for n, k in kinds.items() if k == kind] for kind in sorted(set(kinds.values()))}
    count = ", ".join(f"{len(n)} {kind}{'s' if len(n) > 1 else ''}" for kind, n in by_kind.items())
    tilts, rotors = by_kind.get("tilt", []), by_kind.get("rotor", [])
    quoted = json.dumps(name, ensure_ascii=False)  # a TOML string too
    blocks = [_HEAD.format(name=" ".join(name.split()), quoted=quoted, count=count, fill=FILL_IN)]
    for effector, kind in kinds.items():
        limits, rate, _ = _START[kind]
        unit = EFFECTOR_UNITS[kind]
        blocks.append(
            f'[[effector]]\nname = "{effector}"\nkind = "{kind}"\n'
            f"limits = {limits} # {unit}; {FILL_IN}\nrate_limit = {rate} # {unit} per s; {FILL_IN}\n"
        )
    if tilts:
        blocks.append(_MOUNTS)
    for i, tilt in enumerate(tilts):
        blocks.append(
            f'[[wing]]\nname = "{_mount(tilt, kinds)}"\ntilt = "{tilt}"\n'
            f"pivot_m = [{0.5 - i:.1f}, 0.0, 0.0] # {FILL_IN}\nmass_kg = 0.0 # {FILL_IN}\n"
            f"# cg_m = [{0.6 - i:.1f}, 0.0, 0.0] # needed with a mass, at zero tilt\n"
            "# inertia = { xx = 0.0, yy = 0.0, zz = 0.0 } # about its cg_m, rotor included\n"
        )
    if rotors:
        blocks.append(_ROTORS)
    for i, rotor in enumerate(rotors):
        mount = _mount(_carrier(rotor, tilts), kinds) if tilts else ""
        carrier = f'# wing = "{mount}" # where it turns with one\n' if mount else ""
        side = (i - (len(rotors) - 1) / 2) * 0.5
        blocks.append(
            f'[[rotor]]\nname = "{rotor}"\nspin = {1 if i % 2 == 0 else -1} # {FILL_IN}\n'
            f"inertia = 0.0 # kg m2 of all that spins; {FILL_IN}\n"
            f"axis = [1.0, 0.0, 0.0] # of the thrust, at zero tilt; [0, 0, -1] is upwards\n"
            f"position_m = [0.5, {side:.2f}, 0.0] # {FILL_IN}\n{carrier}diameter_m = 0.4 # {FILL_IN}\n"
        )
    if "surface" in by_kind:
        blocks.append(_SURFACE.format(name=by_kind["surface"][0]))
    angles = "".join(f"{t} = 0.0 # rad; {FILL_IN}\n" for t in tilts)
    blocks += [
        f'[[reference]]\nid = "u{speed}"\nu = {speed}.0 # m/s; {FILL_IN}\nrho = 1.225 # kg/m3\n{angles}'
        for speed in (15, 20)
    ]
    excited = [n for n, kind in kinds.items() if kind != "tilt"]
    period = max(30.0, 10.0 * -(-len(excited) * 5 // 20))
    blocks.append(
        _EXCITATION.format(
            period=period,
            amplitudes="".join(f"{n} = {_START[kinds[n]][2]}\n" for n in excited),
            first="u15",
            fill=FILL_IN,
        )
    )
    listing = ", ".join(f'"{n}"' for n in ("u", "v", "w", "p", "q", "r", *excited))
    blocks.append(_IDENTIFICATION.format(regressors=listing, fill=FILL_IN))
    return "\n".join(blocks)


def _carrier(rotor: str, tilts: list[str]) -> str:
    """Return the tilt whose name ends most like a rotor's (rot_fl, nac_fl): the first where several do."""

    def alike(tilt: str) -> int:
        pairs = zip(reversed(rotor), reversed(tilt), strict=False)
        return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))

    return max(tilts, key=alike)


def _mount(tilt: str, kinds: Mapping[str, str]) -> str:
    """Return a name for what an effector tilts."""
    return f"mount_{tilt}" if f"mount_{tilt}" not in kinds else f"on_{tilt}"


_SURFACE = """\
# For `freqid check` to draw surfaces; nothing else reads it.
# [[surface]]
# name = "{name}"
# hinge_m = [[-1.0, 0.1, 0.0], [-1.0, 0.5, 0.0]] # its ends, at zero tilt
# chord_m = 0.1 # behind the hinge
# wing = "..." # where it turns with one
"""

_HEAD = """\
# {name}: {count}. SI units and radians throughout.
# Lines that say "{fill}" hold a placeholder. `freqid check` lists them, says which commands are ready,
# and draws the aircraft. Every key: docs/scenarios.md.

[vehicle]
name = {quoted}
mass_kg = 10.0 # of all, what tilts included; {fill}
cg_m = [0.0, 0.0, 0.0] # x forward, y right, z down, from an origin of your choice; {fill}
inertia = {{ xx = 1.0, yy = 1.0, zz = 1.5, xz = 0.0 }} # kg m2 about cg_m, xz = + integral of x z dm; {fill}
# area_m2 = 1.0 # for coefficients, with span_m and chord_m
# span_m = 2.0
# chord_m = 0.5
# tilt_rad = {{ mount_x = 0.0 }} # tilts at which cg_m and inertia hold, by [[wing]]; zero where absent
"""
_MOUNTS = """\
# What tilts: a wing, or a nacelle without one. Rotors that name it turn with it; its mass moves the centre
# of gravity.
"""
_ROTORS = """\
# Rotors, so that their angular momentum is accounted for. Not needed where that is negligible.
"""
_EXCITATION = """\
# What is flown to excite the aircraft: freqid design-inputs.
[excitation]
band_hz = [0.1, 2.0] # where the motion and the control law are
period_s = {period}
periods = 2 # with two or more, the lines between harmonics measure noise
fade_s = [1.0, 1.0]
abort = {{ phi = 0.5, theta = 0.35, p = 1.0, q = 0.7, r = 0.7 }} # for the test card

[excitation.amplitude] # in the effector's unit; {fill}
{amplitudes}
# [excitation.at.{first}] # what is different at one reference
# period_s = 40.0
"""
_IDENTIFICATION = """\
[identification]
estimator = "instruments" # not biased by noise in the regressors; needs excitation/* in the log
residuals = "noise-lines" # needs two periods or more
# Tilts that are excited (an amplitude above) must be regressors too.
regressors = [{regressors}]

# [noise] # one sigma of a sample, for forecasts: design-inputs --model
# u = 0.1
# p = 0.002
# ax = 0.1
# surface = 0.001

# [gates]
# r2 = 0.8

# For simulate, study and diagnose-gap of a simulation that freqid flies: [simulation], [control]
# (docs/scenarios.md). A simulation of your own needs neither (docs/connecting.md).
"""


@dataclass(frozen=True)
class Placeholder:
    """A line of a scenario that is still to be filled in.

    Attributes
    ----------
    line : int
    section : str
        With the name of what it describes: ``"[[effector]] de1"``.
    key : str
        Empty where all of the section is to be filled in.
    """

    line: int
    section: str
    key: str


def placeholders(path: Path) -> list[Placeholder]:
    """Return the lines of a scenario that still hold a placeholder.

    Raises
    ------
    DataError
        Where the file cannot be read.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"cannot be read ({error})", where=str(path), remedy="check the path") from None
    found, section = [], ""
    for i, line in enumerate(lines, start=1):
        text = line.split("#")[0].strip()
        key, _, value = (part.strip() for part in text.partition("="))
        if text.startswith("["):
            section, key = text, ""
        elif key in ("name", "id") and section.startswith("[["):
            section = f"{section} {value.strip(chr(34))}"
        if FILL_IN in line and not line.startswith("#"):
            found.append(Placeholder(i, section, key))
    return found

"""How numbers, units and names are written for people."""

from __future__ import annotations

import math
import re

from markupsafe import Markup

from freqid.core.channels import WRENCH, WRENCH_MEANING
from freqid.core.units import to_si

NONE = "–"
"""Stands where there is no number to show."""

_MOST_DIGITS = 8
# What engineers read, by SI unit; a rotor's rad/s goes to rpm instead.
_SHOWN = {"rad": "deg", "rad/s": "deg/s", "rad/s2": "deg/s2"}
_ROTOR_SHOWN = {"rad/s": "rpm"}
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_COEFFICIENT = {"X": "X", "Y": "Y", "Z": "Z", "L": "l", "M": "m", "N": "n"}


def shown_unit(channel: str, unit: str) -> tuple[str, float]:
    """Return the unit that a channel is drawn in, and the factor that converts its SI values to it.

    Parameters
    ----------
    channel : str
        ``group/name``; decides whether rad/s is a rotor's speed.
    unit : str
        SI unit of the channel.
    """
    turns = channel.startswith(("effector/", "command/", "excitation/"))
    shown = (_ROTOR_SHOWN if turns and unit in _ROTOR_SHOWN else _SHOWN).get(unit, unit)
    return (shown, 1.0 / to_si(shown, unit, channel).factor) if shown != unit else (unit, 1.0)


def pretty_unit(unit: str) -> str:
    """Return a unit with its exponents raised; a dash for a pure number."""
    if unit == "1":
        return NONE
    return re.sub(r"(?<=[A-Za-z])-?\d+", lambda match: match[0].translate(_SUPERSCRIPT), unit)


def with_unit(label: str, unit: str) -> str:
    """Return an axis label: the quantity, and its unit in brackets unless it is a pure number."""
    return label if unit == "1" else f"{label} ({pretty_unit(unit)})"


def symbol(response: str, form: str) -> Markup:
    """Return the symbol of a response for the page: N, or C with a lower n for a coefficient."""
    if form == "coefficient" and response in WRENCH:
        return Markup("<i>C</i><sub>{}</sub>").format(_COEFFICIENT[response])
    return Markup("<i>{}</i>").format(response)


def formula(response: str, form: str) -> str:
    """Return the symbol of a response as a figure writes it."""
    if form == "coefficient" and response in WRENCH:
        return f"$C_{_COEFFICIENT[response]}$"
    return response.replace("$", r"\$")


def plain_symbol(response: str, form: str) -> str:
    """Return the symbol of a response where no markup can stand."""
    return f"C{_COEFFICIENT[response]}" if form == "coefficient" and response in WRENCH else response


def meaning(response: str, form: str) -> str:
    """Return what a response is, in words; empty for a name that is not of the wrench."""
    words = WRENCH_MEANING.get(response, "")
    if words and form == "coefficient":
        return f"{words} coefficient"
    if words and form == "specific":
        return f"{words} per {'mass' if response in 'XYZ' else 'inertia'}"
    return words


def number(value: float, digits: int = 3) -> str:
    """Return a number to some significant digits, whole where it is large, a dash where it is not finite."""
    if not math.isfinite(value):
        return NONE
    if value and not 1e-4 <= abs(value) < 1e6:
        exponent = math.floor(math.log10(abs(value)))
        return _signed(f"{value / 10.0**exponent:.{digits - 1}f}") + _power(exponent)
    decimals = digits - 1 - math.floor(math.log10(abs(value))) if value else 0
    return _signed(f"{value:.{max(decimals, 0)}f}")


def short(value: float) -> str:
    """Return a number as one would write it by hand: about four digits, no zeros at the end."""
    if not math.isfinite(value):
        return NONE
    return _signed(f"{value:.0f}" if 1e4 <= abs(value) < 1e6 else f"{value:.4g}")


def share(value: float) -> str:
    """Return a share of one, such as R2, with the digits that tell 0.99 from 0.9998."""
    if not math.isfinite(value):
        return NONE
    if abs(value) >= 100:
        return number(value)
    short_of_one = 1.0 - value
    decimals = 3 if short_of_one > 1e-2 else 4
    return _signed(f"{value:.{decimals}f}" if short_of_one >= 5e-5 else f"{value:.6f}")


def tenths(value: float) -> str:
    """Return a number to one decimal, for what is counted in standard deviations."""
    return _signed(f"{value:.1f}") if math.isfinite(value) else NONE


def percent(value: float) -> str:
    """Return a share of one in percent to two digits."""
    if not math.isfinite(value):
        return NONE
    if value > 10:
        return "> 1000 %"
    return f"{number(100 * value, 2)} %"


def exact(value: float, text: str) -> Markup | str:
    """Return a number as text that carries its full value for whoever copies or checks it."""
    if not math.isfinite(value):
        return NONE
    return Markup('<data value="{!r}">{}</data>').format(float(value), text)


def measured_values(std_error: float, *values: float) -> tuple[str, ...]:
    """Return a standard error and values beside it, all to the place of the error's second digit.

    Parameters
    ----------
    std_error : float
    *values : float
        The estimate, the limits of its interval.

    Returns
    -------
    tuple of str
        The standard error first. All share one power of ten where plain decimals would be long.

    Examples
    --------
    >>> measured_values(0.00123, -0.087312)
    ('0.0012', '−0.0873')
    """
    if not (math.isfinite(std_error) and std_error > 0):
        return (NONE, *(number(value, 4) for value in values))
    largest = max(abs(v) for v in (std_error, *values) if math.isfinite(v))
    leading = math.floor(math.log10(largest))
    place = math.floor(math.log10(std_error)) - 1
    if float(f"{std_error:.1e}") >= 10.0 ** (place + 2):  # 0.0998 rounds up to 0.10
        place += 1
    if leading - place >= _MOST_DIGITS:  # a model without noise: the error needs a power of its own
        return (number(std_error, 2), *(number(value, _MOST_DIGITS) for value in values))
    exponent = 0 if -4 <= leading < 6 else 3 * (leading // 3)
    if exponent and place > exponent:  # 0.45 rather than 450, whose zero would say nothing
        exponent += 3
    decimals = max(exponent - place, 0)

    def written(value: float) -> str:
        if not math.isfinite(value):
            return NONE
        return _signed(f"{round(value, -place) / 10.0**exponent:.{decimals}f}") + _power(exponent)

    return tuple(written(value) for value in (std_error, *values))


def _power(exponent: int) -> str:
    return f"×10{str(exponent).translate(_SUPERSCRIPT)}" if exponent else ""


def _signed(text: str) -> str:
    """Return a number with a true minus sign, and no sign on a zero."""
    if text.startswith("-") and not text.strip("-0."):
        text = text[1:]
    return text.replace("-", "−")


def sentence(text: str) -> str:
    """Return a text of a result as a page writes sentences: a capital first, true minus signs.

    Examples
    --------
    >>> sentence("mass -0.16 (-0.18 to -0.14), mostly 0-0.12 Hz")
    'Mass −0.16 (−0.18 to −0.14), mostly 0-0.12 Hz'
    """
    return text[:1].upper() + re.sub(r"(?<!\w)-(?=\d)", "−", text[1:])

import math

import pytest

from freqid.core.errors import DataError
from freqid.core.units import parse_unit, to_si


# Factors from NIST SP 811 (2008), appendix B, typed here and not computed from our table.
@pytest.mark.parametrize(
    ("unit", "si", "factor"),
    [
        ("ft/s", "m/s", 0.3048),
        ("slug", "kg", 14.59390),
        ("slug/ft3", "kg/m3", 515.3788),
        ("slug ft2", "kg m2", 1.355818),
        ("slug-ft2", "kg m2", 1.355818),
        ("lbf", "N", 4.448222),
        ("psf", "Pa", 47.88026),
        ("kt", "m/s", 0.5144444),
        ("deg/s", "rad/s", 0.01745329),
        ("dps", "rad/s", 0.01745329),
        ("rpm", "rad/s", 0.1047198),
        ("rev/s", "rad/s", 6.283185),
        ("lbf*ft", "N m", 1.355818),
        ("in", "m", 0.0254),
        ("g", "m/s2", 9.80665),
        ("m/s^2", "m/s2", 1.0),
        ("deg/s**2", "rad/s2", 0.01745329),
        ("N/m2", "Pa", 1.0),
    ],
)
def test_factors_agree_with_published_ones(unit, si, factor):
    assert to_si(unit, si, "x").factor == pytest.approx(factor, rel=5e-7)


def test_temperatures_have_an_offset():
    unit = to_si("degF", "K", "oat")
    assert unit.factor * 59.0 + unit.offset == pytest.approx(288.15)


def test_an_offset_unit_inside_an_expression_is_a_difference():
    assert parse_unit("W/degC").factor == 1.0


@pytest.mark.parametrize(
    ("unit", "si", "says"),
    [
        ("Hz", "rad/s", "rev/s or rpm"),
        ("1", "rad", "expected a unit that converts to 'rad'"),
        ("deg", "rad/s", "found unit 'deg'"),
        ("ft/sek", "m/s", "'sek'"),
        ("", "m", "a unit is missing"),
        ("m//s", "m/s", "not understood"),
    ],
)
def test_a_wrong_unit_names_the_channel_and_what_was_found(unit, si, says):
    with pytest.raises(DataError, match="effector/n1") as caught:
        to_si(unit, si, "effector/n1")
    assert says in str(caught.value)


def test_every_symbol_is_its_own_inverse():
    from freqid.core import units

    for symbol in units._SYMBOLS:
        if symbol not in {"1", "%"} and not units._SYMBOLS[symbol].offset:
            square = parse_unit(f"{symbol}2/{symbol}")
            assert math.isclose(square.factor, parse_unit(symbol).factor)
            assert square.dimension == parse_unit(symbol).dimension

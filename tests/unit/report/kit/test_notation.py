from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from freqid.core.errors import DataError
from freqid.report.kit import notation

POWERS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻−", "0123456789--")


def read(text: str) -> float:
    mantissa, _, power = text.partition("×10")
    return float(mantissa.translate(POWERS)) * 10.0 ** int(power.translate(POWERS) or 0)


@pytest.mark.parametrize(
    ("error", "value", "shown"),
    [
        (0.00123, -0.087312, ("0.0012", "−0.0873")),
        (0.0998, 1.0, ("0.10", "1.00")),
        (0.0094999, 1.0, ("0.0095", "1.0000")),
        (1234.0, 56789.0, ("1200", "56800")),
        (2.0, -0.3, ("2.0", "−0.3")),
        (3e-6, 4.2e-5, ("3.0×10⁻⁶", "42.0×10⁻⁶")),
        (4e5, 3.21e7, ("0.40×10⁶", "32.10×10⁶")),
        (0.5, -0.02, ("0.50", "−0.02")),
        (0.0, 1.23456, ("–", "1.235")),
        (math.nan, 1.23456, ("–", "1.235")),
        (1e-15, 1.0, ("1.0×10⁻¹⁵", "1.0000000")),
        (0.5, -0.0001, ("0.50", "0.00")),
        (4.5e-4, 9.3e-5, ("0.00045", "0.00009")),
        (4.5e-7, 9.3e-8, ("0.45×10⁻⁶", "0.09×10⁻⁶")),
    ],
)
def test_an_estimate_ends_where_its_error_does(error, value, shown):
    assert notation.measured_values(error, value) == shown


@given(
    st.floats(1e-30, 1e30),
    st.floats(-1e30, 1e30, allow_subnormal=False),
)
def test_what_is_shown_is_within_a_tenth_of_the_error(error, value):
    shown_error, shown = notation.measured_values(error, value)
    assert abs(read(shown_error) - error) <= 0.051 * error
    # half a unit of the second digit of the error, or eight digits where the error is finer than that
    assert abs(read(shown) - value) <= max(0.051 * error, 1e-7 * abs(value))
    assert "e" not in shown + shown_error


@given(st.floats(allow_nan=True, allow_infinity=True), st.integers(2, 6))
def test_a_number_keeps_its_digits(value, digits):
    text = notation.number(value, digits)
    if not math.isfinite(value):
        assert text == "–"
    elif 1e-300 < abs(value) < 1e300:
        assert read(text) == pytest.approx(value, rel=0.5001 * 10.0 ** (1 - digits))


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.9941, "0.9941"), (0.95, "0.950"), (0.99999, "0.999990"), (1.0, "1.000000"), (-0.2, "−0.200")],
)
def test_a_share_shows_how_far_it_is_from_one(value, shown):
    assert notation.share(value) == shown


def test_units_as_engineers_read_them():
    assert notation.shown_unit("state/p", "rad/s") == ("deg/s", pytest.approx(180 / math.pi))
    assert notation.shown_unit("effector/n1", "rad/s") == ("rpm", pytest.approx(30 / math.pi))
    assert notation.shown_unit("effector/da", "rad") == ("deg", pytest.approx(180 / math.pi))
    assert notation.shown_unit("state/ax", "m/s2") == ("m/s2", 1.0)
    assert notation.pretty_unit("N m/(rad/s2)") == "N m/(rad/s²)"
    assert notation.pretty_unit("1") == "–"
    assert notation.pretty_unit("1/rad") == "1/rad"
    assert notation.with_unit("ax", "m/s2") == "ax (m/s²)"
    assert notation.with_unit("Cn", "1") == "Cn"


def test_a_unit_that_is_not_known_is_left_alone():
    assert notation.shown_unit("effector/x", "furlong") == ("furlong", 1.0)
    with pytest.raises(DataError):
        notation.to_si("furlong", "m", "x")


def test_symbols_of_coefficients():
    assert notation.symbol("N", "coefficient") == "<i>C</i><sub>n</sub>"
    assert notation.symbol("Y", "coefficient") == "<i>C</i><sub>Y</sub>"
    assert notation.symbol("N", "force") == "<i>N</i>"
    assert notation.symbol("<b>", "coefficient") == "<i>&lt;b&gt;</i>"
    assert notation.plain_symbol("L", "coefficient") == "Cl"
    assert notation.formula("M", "coefficient") == "$C_m$"
    assert notation.formula("a$b", "force") == r"a\$b"

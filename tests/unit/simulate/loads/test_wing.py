"""Section loads from any direction, and what surfaces do to them."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.simulate.loads.sections import SurfaceSection
from freqid.simulate.loads.wing import Section, attachment, flap_effect, section_loads

STALL = 0.32
SECTION = Section(*(jnp.float64(x) for x in (5.9, 1 - np.cos(STALL), 0.016, 0.1, 1.8, -0.03)))
SPEED = 20.0


def loads(alpha: float, slope: float = 0.0, flap_moment: float = 0.0) -> tuple[float, float, float]:
    """Coefficients of lift, drag and moment."""
    arguments = (SPEED * np.cos(alpha), SPEED * np.sin(alpha), slope, flap_moment)
    _, fx, fz, m = section_loads(SECTION, *(jnp.float64(a) for a in arguments))
    lift = (float(fx) * np.sin(alpha) - float(fz) * np.cos(alpha)) / SPEED**2
    drag = -(float(fx) * np.cos(alpha) + float(fz) * np.sin(alpha)) / SPEED**2
    return lift, drag, float(m) / SPEED**2


def test_attached_flow():
    lift, drag, moment = loads(0.05)
    assert lift == pytest.approx(5.9 * np.sin(0.05), rel=1e-4)
    assert drag == pytest.approx(0.016 + 0.1 * np.sin(0.05) ** 2, rel=1e-3)
    assert moment == pytest.approx(-0.03, rel=1e-3)


def test_stall_is_where_half_the_flow_has_separated():
    assert float(attachment(jnp.cos(STALL), SECTION.stall)) == pytest.approx(0.5)
    angles = np.linspace(0, 0.7, 141)
    lift = [loads(a)[0] for a in angles]
    peak = angles[int(np.argmax(lift))]
    assert 0.2 < peak < STALL
    assert 1.2 < max(lift) < 1.7
    assert 0.7 * max(lift) < lift[-1] < 0.85 * max(lift)


def test_flat_plate_across_the_flow():
    lift, drag, moment = loads(np.pi / 2)
    assert lift == pytest.approx(0, abs=5e-3)
    assert drag == pytest.approx(1.8 + 0.016, rel=2e-3)
    assert moment == pytest.approx(-1.8 / 4, rel=2e-3)  # pressure at half chord, reference at a quarter


def test_reversed_flow():
    """From behind the section is a plate again, with the force three quarters of the chord back."""
    lift, drag, moment = loads(np.pi - 0.05)
    assert lift < 0
    assert drag == pytest.approx(0.016, abs=0.02)
    normal = 1.8 * np.sin(0.05) / (0.44 + 0.56 * np.sin(0.05))
    assert moment == pytest.approx(-0.5 * normal, rel=2e-3)
    np.testing.assert_allclose(loads(np.pi), loads(-np.pi), atol=1e-12)


@pytest.mark.parametrize("alpha", np.linspace(-3.1, 3.1, 13))
def test_a_plain_section_is_symmetric_and_drags(alpha):
    plain = SECTION._replace(moment=jnp.zeros(()))
    up, down = (
        [float(x) for x in section_loads(plain, jnp.cos(a), jnp.sin(a), jnp.zeros(()), jnp.zeros(()))[1:]]
        for a in (alpha, -alpha)
    )
    np.testing.assert_allclose(up, np.multiply(down, [1, -1, -1]), atol=1e-14)
    assert loads(alpha)[1] > 0.015


def test_still_air_gives_no_load_and_a_gradient():
    zero = jnp.zeros(())
    assert [float(x) for x in section_loads(SECTION, zero, zero, jnp.float64(0.1), zero)] == [0.0] * 4
    slopes = jax.jacobian(lambda u, w: jnp.stack(section_loads(SECTION, u, w, 0.1, 0.0)), (0, 1))(zero, zero)
    assert np.all(np.isfinite(slopes))


def test_flap_effect_is_that_of_thin_aerofoils():
    assert flap_effect(1.0) == pytest.approx((1.0, 0.0))  # the whole section turned
    angle, moment = flap_effect(0.25)  # Katz and Plotkin, section 5.4
    assert angle == pytest.approx(0.609, abs=1e-3)
    assert moment == pytest.approx(-0.6495, abs=1e-3)
    assert flap_effect(0.0) == pytest.approx((0.0, 0.0))


def test_a_deflected_surface_lifts_at_any_attached_angle_and_less_beyond_stall():
    gain = [loads(a, slope=0.1)[0] - loads(a)[0] for a in (0.0, 0.1, 0.6)]
    assert gain[0] == pytest.approx(5.9 * np.sin(np.arctan(0.1)), rel=1e-3)
    assert gain[0] > gain[1] > 2 * gain[2]


@pytest.mark.parametrize("share", [0.0, 1.5, np.nan])
def test_a_flap_is_a_part_of_its_chord(share):
    with pytest.raises(ValueError, match="expected over 0 and up to 1"):
        SurfaceSection("de", "rear", share)

"""Lattice, ducts and pusher of the judging canard against closed forms and slow sums."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from judging_owner import campaign_again, module_of

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks" / "gap_judging" / "canard"
RHO = 1.2


loaded = partial(module_of, FOLDER)


@pytest.fixture(scope="module")
def vortices():
    return loaded("vortices")


@pytest.fixture(scope="module")
def fans():
    return loaded("fans")


def test_one_horseshoe_meets_its_closed_form(vortices):
    span, chord = 3.0, 0.5
    half = (0.0, 0.0, 0.0), (0.0, span / 2, 0.0), chord, chord, 1
    lattice = vortices.Lattice([half])
    lattice_of_two = np.ones(2)  # equal circulation of both halves: one horseshoe over the whole span
    down = lattice._velocity(np.array([[-chord / 2, 0.0, 0.0]]))[0, :, 2] @ lattice_of_two
    d, b = chord / 2, span / 2
    slant = np.hypot(d, b)
    closed = b / (2 * np.pi * d * slant) + (1 + d / slant) / (2 * np.pi * b)
    assert down == pytest.approx(closed, rel=1e-4)


def test_drag_at_a_straight_wing_is_that_of_its_far_wake(vortices):
    lattice = vortices.Lattice([((0.0, 0.0, 0.0), (0.0, 2.5, 0.0), 0.8, 0.4, 8)])
    made = lattice.solve @ np.full(16, 0.1)
    width, y = lattice.bound[:, 1], lattice.middle[:, 1]
    near = (made * (lattice.induced[2] @ made) * width).sum()
    # Trefftz plane: lines of vortices without end, at both sides of every panel
    far = sum(
        g / (2 * np.pi) * (1 / (y - a) - 1 / (y - b))
        for g, a, b in zip(made, lattice.left[:, 1], lattice.right[:, 1], strict=True)
    )
    assert near == pytest.approx(0.5 * (made * far * width).sum(), rel=1e-4)


def test_winglets_pull_against_sideslip_and_wings_up(vortices):
    lattice = vortices.Lattice(
        [
            ((0.0, 0.0, 0.0), (0.0, 2.0, 0.0), 0.5, 0.5, 3),
            ((0.0, 2.0, 0.0), (0.0, 2.0, -0.5), 0.3, 0.3, 1),
        ]
    )
    for velocity, axis, panels in (([20.0, 0, 1.0], 2, slice(0, 6)), ([20.0, 1.0, 0], 1, slice(6, 8))):
        air = -np.array(velocity)
        made = lattice.solve @ (lattice.normal @ air)
        force = np.cross(made[:, None] * air, lattice.bound)
        assert np.all(force[panels, axis] < 0)


@pytest.mark.parametrize("climb", [-3.0, 0.0, 2.0])
def test_duct_spends_what_its_fan_gives(fans, climb):
    tip, edge = 90.0, 19.0
    leaves, rise = fans.duct(np.array(tip), np.array(climb), np.array(edge**2))
    head_before = 0.5 * fans.RECOVERED * edge**2 + 0.5 * climb * abs(climb)
    assert 0.5 * (1 + fans.LOSS) * leaves**2 == pytest.approx(head_before + rise, rel=1e-12)
    assert rise == pytest.approx(fans.HEAD * tip**2 - fans.FALL * tip * leaves, rel=1e-12)
    thrust, flow, torque = fans.fan(RHO, 0.1, np.array(tip), np.array(climb), np.array(edge**2))
    assert flow == pytest.approx(RHO * np.pi * 0.01 * leaves, rel=1e-12)
    assert thrust == pytest.approx(flow * (leaves - climb), rel=1e-12)
    assert torque * tip / 0.1 > flow * rise  # the shaft's power over the air's


def test_pusher_is_the_sum_of_rings_that_are_solved_by_halving(fans):
    radius, chord, speed, along = 0.24, 0.03, 730.0, 18.0
    edges = np.linspace(fans.HUB, fans.TIP_LOSS, 401) * radius
    thrust, torque = 0.0, 0.0
    for r, width in zip(0.5 * (edges[1:] + edges[:-1]), np.diff(edges), strict=True):
        pitch = np.arctan(fans.PITCH / (2 * np.pi * r))
        blades = 0.5 * RHO * fans.BLADES * chord * (speed * r) ** 2
        low, high = 0.0, 60.0
        for _ in range(60):
            v = 0.5 * (low + high)
            lift = blades * fans.SLOPE * (pitch - (along + v) / (speed * r))
            low, high = (v, high) if lift > 4 * np.pi * r * RHO * (along + v) * v else (low, v)
        drag = blades * fans.PROFILE * (1 + ((along + v) / (speed * r)) ** 2)
        slope = (along + v) / (speed * r)
        thrust += (lift - drag * slope) * width
        torque += r * (lift * slope + drag) * width
    made = fans.pusher(RHO, radius, chord, np.array(speed), np.array(along))
    np.testing.assert_allclose(made, (thrust, torque), rtol=2e-3)


def test_committed_polynomials_are_those_that_the_campaign_finds(tmp_path):
    campaign_again(FOLDER, tmp_path, absolute=0.0)

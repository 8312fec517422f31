"""Modes of aircraft that text books have."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.dynamics.modes import MOTION, named_modes


def test_modes_of_a_transport_have_the_names_that_the_books_give():
    """Boeing 747 at Mach 0.8, 40 000 ft (Heffley & Jewell, NASA CR-2144): ft, s, rad."""
    longitudinal = np.array(
        [[-0.003, 0.039, 0, -32.2], [-0.065, -0.319, 774, 0], [0.000201, -0.00101, -0.429, 0], [0, 0, 1, 0]]
    )
    lateral = np.array(
        [
            [-0.0558, 0, -774, 32.2],
            [-0.003865, -0.4342, 0.4136, 0],
            [0.001086, -0.006112, -0.1458, 0],
            [0, 1, 0, 0],
        ]
    )
    A = np.zeros((9, 9))
    along, across = ([MOTION.index(n) for n in names] for names in (("u", "w", "q", "theta"), "vpr"))
    across.append(MOTION.index("phi"))
    A[np.ix_(along, along)], A[np.ix_(across, across)] = longitudinal, lateral
    A[MOTION.index("psi"), MOTION.index("r")] = 1
    modes = {m.name: m for m in named_modes(A)}
    assert set(modes) == {"short period", "phugoid", "Dutch roll", "roll", "spiral", "heading"}
    assert modes["short period"].frequency == pytest.approx(0.963, abs=0.01)
    assert modes["short period"].damping == pytest.approx(0.387, abs=0.01)
    assert modes["phugoid"].frequency == pytest.approx(0.067, abs=0.002)
    assert modes["Dutch roll"].frequency == pytest.approx(0.947, abs=0.01)
    assert modes["roll"].frequency == pytest.approx(0.562, abs=0.01)
    assert modes["spiral"].damping == 1
    assert np.isnan(modes["heading"].damping)


def test_units_of_states_do_not_change_names():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(9, 9))
    scale = np.diag(10.0 ** rng.uniform(-3, 3, 9))
    other = named_modes(np.linalg.solve(scale, A @ scale))
    assert [m.name for m in named_modes(A)] == [m.name for m in other]


def test_states_of_a_controller_are_not_of_the_vehicle():
    A = np.diag([-1.0, -2.0, -3.0])
    assert [m.name for m in named_modes(A, ("w", "p", "filter"))] == ["control", "roll", "heave"]


def test_a_real_eigenvalue_that_grows_has_damping_minus_one():
    (mode,) = named_modes(np.array([[0.5]]), ("w",))
    assert mode.damping == -1

"""A steady motion satisfies the equations it comes from, and a law acts as its gains say."""

import numpy as np

from freqid.dynamics.loop import law_on_lines, steady_motion

HZ = np.array([0.1, 0.4, 1.3])


def test_the_motion_satisfies_the_equations_of_motion_and_the_law():
    rng = np.random.default_rng(3)
    E, A = rng.normal(size=(2, 8, 10))
    gains = rng.normal(size=(3, 2, 8))
    displaced, added = (rng.normal(size=(k, 3)) + 1j * rng.normal(size=(k, 3)) for k in (2, 6))
    x = steady_motion(E, A, law_on_lines(gains, HZ), displaced, HZ, added=added)
    for i, f in enumerate(HZ):
        s = 2j * np.pi * f
        d = (gains[0] / s + gains[1] + gains[2] * s) @ x[:, i] + displaced[:, i]
        both = np.concatenate([x[:, i], d])
        loads = np.concatenate([added[:, i], [0.0, 0.0]])
        np.testing.assert_allclose(s * E @ both, A @ both + loads, rtol=1e-10)


def test_states_that_take_no_part_stay_at_rest():
    rng = np.random.default_rng(4)
    E, A = rng.normal(size=(2, 8, 10))
    moving = np.array([True, False, True, False, True, False, False, True])
    none = np.zeros((3, 2, 8), dtype=complex)
    x = steady_motion(E, A, none, np.ones((2, 3), dtype=complex), HZ, moving=moving)
    assert not x[~moving].any()
    small = np.flatnonzero(moving)
    for i, f in enumerate(HZ):
        s = 2j * np.pi * f
        expected = np.linalg.solve((s * E - A)[np.ix_(small, small)], (A - s * E)[small, 8:] @ np.ones(2))
        np.testing.assert_allclose(x[small, i], expected, rtol=1e-10)

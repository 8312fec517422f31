"""Noise that signatures and residual share, and what it adds to their products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.gap.lines import Lines
from freqid.gap.noise import Noise
from freqid.gap.quiet import Quiet

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_HEARD = 2.0  # power ratio of a channel to the noise left in it from which others' dependence on it is told


@dataclass(frozen=True, eq=False)
class Shared:
    """Noise that signatures and residual have in common, because both are computed from the same channels.

    Attributes
    ----------
    names : tuple of str
        Channels, and ``d/dt`` of each.
    spectra : ndarray of complex, shape (channel, line)
        Of the channels without their noise.
    strength : ndarray, shape (channel, row)
        Inner product of what noise is left in a channel with the white-weighed noise of each row.
    moving : ndarray of bool, shape (channel,)
        Whether a channel stands out of that noise; nothing can be told of the dependence on others.
    """

    names: tuple[str, ...]
    spectra: Complex
    strength: Array
    moving: NDArray[np.bool_]

    def attenuation(self, columns: Complex, channels: Sequence[str]) -> Array:
        """Return what shared noise adds to the products of columns with the residual, shape (column,).

        Parameters
        ----------
        columns : ndarray of complex, shape (column, row, line)
        channels : sequence of str
            That they are computed from.

        Notes
        -----
        A signature is nearly linear in the channels that it is computed from, so it carries their noise as
        it carries their motion. Without this the tests of a perfect simulation are off by a few standard
        errors (errors in variables; docs/theory/gap-diagnosis.md).
        """
        return np.einsum("jci,ji->c", self.slopes(columns, channels), self.strength)

    def slopes(self, columns: Complex, channels: Sequence[str]) -> Array:
        """Return how columns depend on channels, shape (channel, column, row); zero on those at rest."""
        found = np.zeros((len(self.names), *columns.shape[:2]))
        at = [i for i, n in enumerate(self.names) if n in channels and self.moving[i]]
        if not at or not len(columns):
            return found
        z = self.spectra[at]
        x = np.concatenate([z.real, z.imag], axis=1)
        size = np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
        x = x / size
        inner = x @ x.T + 1e-5 * np.eye(len(x))
        flat = np.concatenate([columns.real, columns.imag], axis=2)
        slopes = np.linalg.solve(inner, np.einsum("it,crt->icr", x, flat).reshape(len(x), -1))
        found[at] = (slopes / size).reshape(len(x), *columns.shape[:2])
        return found


def shared_noise(quieted: Quiet, lines: Lines, noise: Noise, made: Complex, added: Complex) -> Shared:
    """Return the noise that what is computed from a quiet record shares with the residual.

    Parameters
    ----------
    quieted : Quiet
    lines : Lines
    noise : Noise
    made, added : ndarray of complex, shapes (draw, row, line) and (draw, channel, line)
        Of `draws`, channels in the order of `quieted.sigma`.
    """
    names = list(quieted.sigma)
    spectra = lines.spectrum(quieted.record.matrix(names))
    spectra = np.concatenate([spectra, 2j * np.pi * lines.hz * spectra])
    left = left_over(quieted, lines, added)
    metric = np.einsum("lki,lkj->lij", noise.whitening.conj(), noise.whitening)
    weighed = np.einsum("lij,kjl->kil", metric, made)
    strength = 2 * np.einsum("kjl,kil->ji", left.conj(), weighed).real / len(made)
    heard = np.mean(np.abs(left) ** 2, axis=(0, 2))
    moving = np.mean(np.abs(spectra) ** 2, axis=1) > _HEARD * np.maximum(heard, 1e-300)
    return Shared((*names, *(f"d/dt {n}" for n in names)), spectra, strength, moving)


def left_over(quieted: Quiet, lines: Lines, added: Complex) -> Complex:
    """Return what a quiet record keeps of noise, shape (draw, channel, line): in channels, then in rates.

    Parameters
    ----------
    quieted : Quiet
    lines : Lines
    added : ndarray of complex, shape (draw, channel, line)
        Noise, in the order of `quieted.sigma`.
    """
    # what the smoothing lets through: `freqid.identify.smoothing.smooth`
    passed = 1 / (1 + (lines.hz / np.array([quieted.cutoff_hz[n] for n in quieted.sigma])[:, None]) ** 6)
    left = added * passed
    return np.concatenate([left, 2j * np.pi * lines.hz * left], axis=1)

"""Polynomials that an owner fits to a wind tunnel: only the terms that matter."""

from __future__ import annotations

import numpy as np

NEGLIGIBLE = 0.002  # share of a load's variation; terms that matter less are left out


def reduced(terms, y, least=NEGLIGIBLE):
    """Return coefficients of the terms that matter, the least one left out after the other."""
    names = list(terms)
    matrix = np.array([terms[n] for n in names]).T
    products, onto = matrix.T @ matrix / len(y), matrix.T @ y / len(y)
    kept = np.arange(len(names))
    while True:
        inverse = np.linalg.pinv(products[np.ix_(kept, kept)], hermitian=True)
        fit = inverse @ onto[kept]
        # What the fit loses without a term, the others fitted anew
        loss = np.abs(fit) / np.sqrt(np.maximum(np.diag(inverse), 1e-30)) / np.std(y)
        if loss.min() > least:
            left = np.std(y - matrix[:, kept] @ fit) / np.std(y)
            return {names[i]: float(c) for i, c in zip(kept, fit, strict=True)}, left
        kept = np.delete(kept, np.argmin(loss))

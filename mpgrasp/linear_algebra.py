"""Products, norms and singular values of small arrays, without the BLAS that numpy was built with.

OpenBLAS picks the kernel of its products by the processor (OPENBLAS_CORETYPE overrides it), and another
kernel rounds otherwise; a last digit becomes another outcome in a few of a hundred episodes. What stands
between a seed and an outcome is therefore computed here: numpy's own loops for products, OpenCV's Jacobi
rotations for singular values.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

try:
    # einsum itself, without the call in Python that looks at its options and takes as long again
    from numpy._core.multiarray import c_einsum as _einsum
except ImportError:
    from numpy import einsum as _einsum

Array = NDArray[np.floating]

_LARGEST_SVD = 24
"""Rows and columns up to which OpenCV takes its own singular value decomposition; beyond, LAPACK's."""


class Svd(NamedTuple):
    """Factors of a matrix (m, n) = U diag(sigma) Vt, with k = min(m, n)."""

    U: Array
    """(m, k), orthonormal columns."""
    sigma: Array
    """(k,), falling."""
    Vt: Array
    """(k, n), orthonormal rows."""


def product(a: Array, b: Array) -> Array:
    """Return the product of a (m, n) and b (n, k) or (n,)."""
    result: Array = _einsum("ij,jk->ik" if b.ndim == 2 else "ij,j->i", a, b)
    return result


def dot(a: Array, b: Array) -> float:
    """Return the scalar product of a (n,) and b (n,)."""
    return float(_einsum("i,i->", a, b))


def norm(v: ArrayLike) -> float:
    """Return the Euclidean length of a vector (n,); quick for short ones."""
    return math.hypot(*np.asarray(v, float).tolist())


def svd(matrix: Array) -> Svd:
    """Return the singular value decomposition of a matrix (m, n) of at most 24 rows and columns.

    Raises:
        ValueError: a larger matrix.
    """
    if max(matrix.shape) > _LARGEST_SVD:
        raise ValueError(f"svd takes up to {_LARGEST_SVD} rows and columns, got {matrix.shape}")
    sigma, U, Vt = cv2.SVDecomp(np.ascontiguousarray(matrix, np.float64))
    return Svd(np.asarray(U, float), np.asarray(sigma, float)[:, 0], np.asarray(Vt, float))


def least_squares(matrix: Array, right: Array, cut: float) -> Array:
    """Return the shortest x (n,) that brings matrix (m, n) times x closest to `right` (m,).

    Args:
        matrix: of at most 24 rows and columns.
        right: right-hand side.
        cut: share of the largest singular value below which one counts as zero.
    """
    U, sigma, Vt = svd(matrix)
    used = sigma > cut * sigma[0]
    return product(Vt.T, np.where(used, product(U.T, right) / np.where(used, sigma, 1.0), 0.0))


def least_norm(factors: Svd, right: Array, smallest: float) -> Array:
    """Return the shortest x (n,) that brings the matrix of these factors times x closest to `right` (m,).

    Args:
        factors: of the matrix.
        right: right-hand side (m,).
        smallest: singular values are taken for this large at least.
    """
    return product(factors.Vt.T, product(factors.U.T, right) / np.maximum(factors.sigma, smallest))

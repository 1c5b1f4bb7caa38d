"""Laws of the small linear algebra, against numpy's own, which goes through BLAS and LAPACK."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.linear_algebra import dot, least_norm, least_squares, norm, product, svd

SHAPES = [(6, 7), (7, 6), (3, 3), (1, 5), (24, 24)]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_product_is_that_of_the_matrices(shape: tuple[int, int], rng: np.random.Generator) -> None:
    a = rng.standard_normal(shape)
    for b in (rng.standard_normal((shape[1], 4)), rng.standard_normal(shape[1])):
        np.testing.assert_allclose(product(a, b), a @ b, rtol=1e-13, atol=1e-13)


def test_dot_and_norm_are_those_of_the_vectors(rng: np.random.Generator) -> None:
    a, b = rng.standard_normal((2, 9))
    assert dot(a, b) == pytest.approx(a @ b, rel=1e-13)
    assert norm(a) == pytest.approx(np.linalg.norm(a), rel=1e-13)
    assert norm([3.0, 4.0]) == 5.0


@pytest.mark.parametrize("shape", SHAPES)
def test_singular_values_fall_and_their_factors_multiply_to_the_matrix(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    matrix = rng.standard_normal(shape)
    U, sigma, Vt = svd(matrix)
    np.testing.assert_allclose(sigma, np.linalg.svd(matrix, compute_uv=False), rtol=1e-10)
    np.testing.assert_allclose(U * sigma @ Vt, matrix, atol=1e-12)
    np.testing.assert_allclose(Vt @ Vt.T, np.eye(len(sigma)), atol=1e-12)


def test_a_singular_matrix_has_a_singular_value_of_zero() -> None:
    assert svd(np.ones((6, 7))).sigma[1:] == pytest.approx(0.0, abs=1e-12)


def test_a_matrix_that_is_no_small_one_is_refused() -> None:
    with pytest.raises(ValueError, match="24 rows"):
        svd(np.zeros((25, 3)))


@pytest.mark.parametrize("shape", SHAPES)
def test_least_squares_are_those_of_the_pseudo_inverse(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    matrix, right = rng.standard_normal(shape), rng.standard_normal(shape[0])
    expected = np.linalg.pinv(matrix) @ right
    np.testing.assert_allclose(least_squares(matrix, right, 1e-9), expected, atol=1e-9)
    np.testing.assert_allclose(least_norm(svd(matrix), right, 1e-12), expected, atol=1e-9)


def test_least_squares_leave_out_what_is_below_the_cut() -> None:
    matrix = np.diag([1.0, 1e-4])
    assert least_squares(matrix, np.ones(2), 1e-3) == pytest.approx([1.0, 0.0])
    assert least_squares(matrix, np.ones(2), 1e-5) == pytest.approx([1.0, 1e4])

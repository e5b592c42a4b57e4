"""Ten Kalman filters of a tumble's errors, side by side in C, against those of a textbook in numpy, one by one."""

import ctypes

import numpy as np
import pytest

from compiling import ONLY_WHAT_IS_CALLED, online_core_of

ERRORS, TORQUES, FREE = 11, 10, 3  # of a spin, densities of white torque, errors that a free tumble leaves as they are
DENSITY = 1e-15 * 10.0 ** np.arange(TORQUES)
ROUNDING = 1e-12  # relative: products of a dozen terms, of a covariance that is well conditioned

TAKEN = """#include "library.c"
int size_of_errors(void) { return (int)sizeof(SpinErrors); }
void taken(SpinErrors *errors, int pulled, const double F[6][SPIN], const double Q[6][6], const double turn[3],
           const double noise[3][3], double squares[TORQUES])
{
    errors_on(errors, pulled, F, Q);
    update_errors(errors, turn, noise, squares);
}"""


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    """The core with `taken`."""
    return online_core_of(tmp_path_factory.mktemp("torques"), TAKEN, *ONLY_WHAT_IS_CALLED)


@pytest.fixture
def case():
    """Errors and covariances of ten filters, F, Q, the turn that is seen, and its noise."""
    rng = np.random.default_rng(10)
    F = np.eye(6, ERRORS) + 0.3 * rng.standard_normal((6, ERRORS))
    A, B, C = (rng.standard_normal((n, size, size)) for n, size in ((TORQUES, ERRORS), (1, 6), (1, 3)))
    P, Q, noise = (each @ each.mT + np.eye(each.shape[-1]) for each in (A, B, C))
    return rng.standard_normal((TORQUES, ERRORS)), P, F, Q[0], rng.standard_normal(3), noise[0]


def in_c(core, pulled, case):
    """x (10, 11), the lower triangles (10, 66), logarithms of weights (10,) and squares (10,) after a node."""
    x, P, F, Q, turn, noise = case
    lower = np.tril_indices(ERRORS)
    errors = np.concatenate([x.T, P[:, *lower].T, np.zeros((1, TORQUES))])
    assert core.size_of_errors() == errors.nbytes
    squares = np.empty(TORQUES)
    given = [np.ascontiguousarray(each) for each in (F, Q, turn, noise)]
    errors = np.ascontiguousarray(errors)
    core.taken(
        errors.ctypes.data_as(ctypes.c_void_p), pulled, *(e.ctypes.data_as(ctypes.c_void_p) for e in (*given, squares))
    )
    return errors[:ERRORS].T, errors[ERRORS:-1].T, errors[-1], squares


def in_numpy(x, P, F, Q, turn, noise, density):
    """The same of one filter: the prediction, and the update by the inverse of the innovation's covariance."""
    whole = np.vstack([F, np.eye(5, ERRORS, 6)])
    x, P = whole @ x, whole @ P @ whole.T
    P[:6, :6] += density * Q
    S, e = P[:3, :3] + noise, turn - x[:3]
    gain = np.linalg.solve(S, P[:3]).T
    square = e @ np.linalg.solve(S, e)
    P_after = P - gain @ P[:3]
    return x + gain @ e, P_after[np.tril_indices(ERRORS)], -0.5 * (square + np.linalg.slogdet(S)[1]), square


@pytest.mark.parametrize("pulled", [False, True])
def test_they_are_ten_kalman_filters(core, case, pulled):
    x, P, F, Q, turn, noise = case
    if not pulled:
        F[:, :FREE] = np.eye(6, FREE)
    found = in_c(core, pulled, case)
    each = [in_numpy(x[m], P[m], F, Q, turn, noise, DENSITY[m]) for m in range(TORQUES)]
    for one, expected in zip(found, zip(*each, strict=True), strict=True):
        scale = np.abs(expected).max()
        np.testing.assert_allclose(one, expected, rtol=0, atol=ROUNDING * scale)


def test_one_that_rounding_left_indefinite_is_given_up(core, case):
    """It kept its weight, and was not updated: as likely as before, whatever the node said."""
    x, P, F, Q, turn, noise = case
    P[4] = 0.0
    P[4, 0, 0] = -10.0 * noise.trace()
    F = np.eye(6, ERRORS)
    after, covariance, weight, squares = in_c(core, False, (x, P, F, Q, turn, noise))
    assert weight[4] == -np.inf
    assert squares[4] == np.inf
    np.testing.assert_array_equal(after[4], x[4])
    others = np.arange(TORQUES) != 4
    for finite in (weight[others], squares[others], covariance):
        assert np.isfinite(finite).all()

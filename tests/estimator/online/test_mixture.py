"""How the large filter follows its bank of small ones: the C of mixture.c, called by itself."""

import ctypes

import numpy as np
import pytest

from compiling import ONLY_WHAT_IS_CALLED, online_core_of

FUNCTIONS = """#include "library.c"
int level(void) { return PATH_AND_MAP; }
static void known(double P[PATH_AND_MAP][PATH_AND_MAP], Member *member)
{
    *member = (Member){.errors = PATH_AND_MAP};
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int b = 0; b < PATH_AND_MAP; b++) member->P[a][b] = P[a][b];
}
void answer(double of_shadow[PATH_AND_MAP][PATH_AND_MAP], double of_member[PATH_AND_MAP][PATH_AND_MAP],
            double of_large[PATH_AND_MAP][PATH_AND_MAP], double found[PATH_AND_MAP][PATH_AND_MAP])
{
    static PackedMember bank[MEMBERS + 1];
    double x[ERRORS], P[ERRORS][ERRORS], more[PATH_AND_MAP][PATH_AND_MAP];
    Member shadow, member, large;
    for (int m = 0; m < MEMBERS; m++) bank[m].weight = -INFINITY;
    known(of_shadow, &shadow), known(of_member, &member), known(of_large, &large);
    pack_member(&shadow, &bank[SHADOW]), pack_member(&member, &bank[0]);
    mixture(bank, STRAIGHT, &large, x, P, more);
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int b = 0; b < PATH_AND_MAP; b++) found[a][b] = P[a][b];
}
void places(double of_shadow[PATH_AND_MAP][PATH_AND_MAP], const double at[3][PATH_AND_MAP], double found[PATH_AND_MAP])
{
    static PackedMember bank[MEMBERS + 1];
    double unit[PATH_AND_MAP][PATH_AND_MAP] = {{0}}, x[ERRORS], P[ERRORS][ERRORS], more[PATH_AND_MAP][PATH_AND_MAP];
    Member shadow, member, large;
    for (int m = 0; m < MEMBERS; m++) bank[m].weight = -INFINITY;
    for (int a = 0; a < PATH_AND_MAP; a++) unit[a][a] = 1.0;
    known(of_shadow, &shadow), known(unit, &member), known(unit, &large);
    for (int a = 0; a < PATH_AND_MAP; a++) shadow.x[a] = at[0][a], member.x[a] = at[1][a], large.x[a] = at[2][a];
    pack_member(&shadow, &bank[SHADOW]), pack_member(&member, &bank[0]);
    mixture(bank, STRAIGHT, &large, x, P, more);
    for (int a = 0; a < PATH_AND_MAP; a++) found[a] = large.x[a] + x[a];
}"""


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    return online_core_of(tmp_path_factory.mktemp("core"), FUNCTIONS, *ONLY_WHAT_IS_CALLED)


@pytest.mark.parametrize("times", [0.5, 1.0, 4.0])
def test_an_answer_is_wider_by_what_the_large_filter_lacks_and_no_more(core, times):
    """Of a shadow known to a metre, where the bank knows a direction to a millimetre, and another to nearly a metre.

    The large filter knows `times` the shadow's variance along the middle of the two. Less of it is information that
    the bank has not, of the closed form D⁻¹ + V⁻¹ − 1; more widens the bank's covariance D by that factor at most, in
    any direction: it made decimetres of the millimetre, and a hundredth of the variance of another direction.
    """
    n, rng = core.level(), np.random.default_rng(3)
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    of_member = basis @ np.diag(np.r_[1e-6, np.full(n - 1, 0.9)]) @ basis.T
    middle = (basis[:, 0] + basis[:, 1]) / np.sqrt(2)
    of_large = np.eye(n) + (times - 1) * np.outer(middle, middle)
    found = np.zeros((n, n))
    given = (np.ascontiguousarray(P) for P in (np.eye(n), of_member, of_large))
    core.answer(*(one.ctypes.data_as(ctypes.c_void_p) for one in (*given, found)))
    root = np.linalg.cholesky(np.linalg.inv(of_member))
    wider = np.linalg.eigvalsh(root.T @ found @ root)
    if times > 1:
        assert wider.min() > 1 - 1e-6
        assert wider.max() < times + 1e-6
        assert wider.max() > 1.5
    else:
        expected = np.linalg.inv(np.linalg.inv(of_member) + np.linalg.inv(of_large) - np.eye(n))
        np.testing.assert_allclose(wider, np.linalg.eigvalsh(root.T @ expected @ root), rtol=1e-6)


def test_where_rounding_leaves_the_shadow_no_covariance_the_answer_is_where_the_bank_is(core):
    """It was as far from the large filter as the bank is from its shadow, wherever that was."""
    n, rng = core.level(), np.random.default_rng(4)
    at, found, singular = rng.standard_normal((3, n)), np.zeros(n), np.diag(np.r_[np.ones(n - 1), 0.0])
    core.places(*(np.ascontiguousarray(one).ctypes.data_as(ctypes.c_void_p) for one in (singular, at, found)))
    np.testing.assert_allclose(found, at[1], rtol=1e-12)

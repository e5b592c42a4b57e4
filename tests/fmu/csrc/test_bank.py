"""The bank of densities in C: between which quantiles its covariance is claimed."""

import ctypes

import numpy as np
import pytest

from compiling import library_of

CODE = """#include <math.h>
#include <stddef.h>
#include "online.h"
#include "small.h"
#include "frames.h"
#include "bank.c"
int densities(void) { return DENSITIES; }
int members(void) { return MEMBERS; }
void claimed_weights(const double *logarithm, const double *steady, double *weights, double *claimed) {
    Member bank[MEMBERS + 1] = {0};
    for (int m = 0; m < MEMBERS; m++) bank[m].weight = logarithm[m], bank[m].steady = steady[m];
    weights_of(bank, weights, claimed);
}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory, request):
    headers = request.config.rootpath / "fmu" / "csrc" / "online"
    return library_of(tmp_path_factory.mktemp("bank"), CODE, f"-I{headers}")


def weights_of(library, logarithm, steady):
    doubles = ctypes.c_double * library.members()
    weights, claimed = doubles(), doubles()
    library.claimed_weights(doubles(*logarithm), doubles(*steady), weights, claimed)
    return np.array(weights), np.array(claimed)


def test_the_claim_is_that_between_two_quantiles_of_the_density(library):
    """Against many quantiles, each that of a whole density, which its members share by their weights."""
    rng, steady_ones, jumping = np.random.default_rng(5), library.densities(), library.members() - library.densities()
    assert jumping > 1
    for _ in range(50):
        logarithm = np.append(rng.uniform(-6, 0, steady_ones), rng.uniform(-6, 0, jumping))
        logarithm[-1] = -np.inf  # one that is none, of no density
        steady = np.concatenate([np.arange(steady_ones), rng.integers(0, steady_ones, jumping)])
        steady[-1] = library.members() - 1
        weights, claimed = weights_of(library, logarithm, steady)
        expected = np.exp(logarithm) / np.exp(logarithm).sum()
        np.testing.assert_allclose(weights, expected, rtol=1e-12)
        of_density = np.bincount(steady[:-1].astype(int), expected[:-1], steady_ones)
        quantiles = np.searchsorted(np.cumsum(of_density), np.linspace(0.7, 0.9, 20001))
        share = np.bincount(quantiles, minlength=steady_ones) / 20001
        own = expected[:-1] / of_density[steady[:-1].astype(int)] * share[steady[:-1].astype(int)]
        np.testing.assert_allclose(claimed, np.append(own, 0.0), atol=2e-4)


def test_one_likely_density_is_claimed_alone(library):
    logarithm = np.full(library.members(), -np.inf)
    logarithm[3] = 0.0
    weights, claimed = weights_of(library, logarithm, np.arange(library.members()))
    np.testing.assert_allclose(claimed, weights, rtol=1e-12)
    assert claimed[3] == pytest.approx(1.0, abs=1e-12)

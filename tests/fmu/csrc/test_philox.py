"""The unit's random numbers in C: published vectors, and bit for bit those of numpy."""

import ctypes

import numpy as np
import pytest

from baryscope.models.sensor.draws import Purpose, uniforms
from compiling import library_of

CODE = """#include "philox.h"
void draw(const uint64_t *counter, const uint64_t *key, uint64_t *out) { philox(counter, key, out); }
void uniform(uint64_t seed, uint64_t purpose, uint64_t frame, uint64_t feature, double *out)
{ uniform_draws(seed, purpose, frame, feature, out); }
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory, request):
    return library_of(tmp_path_factory.mktemp("philox"), CODE, f"-I{request.config.rootpath / 'fmu' / 'csrc'}")


def words(*values):
    return (ctypes.c_uint64 * len(values))(*values)


def test_bits_are_those_of_numpy(library):
    rng, found = np.random.default_rng(3), words(0, 0, 0, 0)
    for _ in range(200):
        counter, key = (rng.integers(0, 2**64, size, dtype=np.uint64) for size in (4, 2))
        counter[0] = max(counter[0], 1)
        source = np.random.Philox(counter=counter - np.array([1, 0, 0, 0], dtype=np.uint64), key=key)
        library.draw(words(*counter.tolist()), words(*key.tolist()), found)
        assert list(found) == source.random_raw(4).tolist()


def test_a_published_vector(library):
    """Random123's kat_vectors: philox4x64 10, all ones."""
    found, ones = words(0, 0, 0, 0), 2**64 - 1
    library.draw(words(ones, ones, ones, ones), words(ones, ones), found)
    assert list(found) == [0x87B092C3013FE90B, 0x438C3C67BE8D0224, 0x9CC7D7C69CD777B6, 0xA09CAEBF594F0BA0]


@pytest.mark.parametrize("purpose", list(Purpose))
def test_uniforms_are_those_of_the_campaign(library, purpose):
    found, seed = (ctypes.c_double * 4)(), 2**53 - 1
    expected = uniforms(seed, purpose, (50, 4))
    for frame in range(50):
        for feature in range(4):
            library.uniform(*(ctypes.c_uint64(word) for word in (seed, purpose, frame, feature)), found)
            assert list(found) == expected[frame, feature].tolist()

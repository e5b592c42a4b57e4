"""Random numbers by counter: published vectors, what they depend on, and their statistics."""

import casadi as ca
import numpy as np
import pytest
from scipy import stats

from baryscope.models.sensor.draws import Purpose, normals_of, standard_normals, uniforms

ALL = 2**64 - 1
# Random123's kat_vectors, "philox4x64 10": counter, key, result.
VECTORS = [
    ([0, 0, 0, 0], [0, 0], [0x16554D9ECA36314C, 0xDB20FE9D672D0FDC, 0xD7E772CEE186176B, 0x7E68B68AEC7BA23B]),
    ([ALL] * 4, [ALL] * 2, [0x87B092C3013FE90B, 0x438C3C67BE8D0224, 0x9CC7D7C69CD777B6, 0xA09CAEBF594F0BA0]),
    (
        [0x243F6A8885A308D3, 0x13198A2E03707344, 0xA4093822299F31D0, 0x082EFA98EC4E6C89],
        [0x452821E638D01377, 0xBE5466CF34E90C6C],
        [0xA528F45403E61D95, 0x38C72DBD566E9788, 0xA5A1610E72FD18B5, 0x57BD43B5E52B7FE6],
    ),
]
SIGMAS = 5.0  # a statistic may be off by so many of its own standard deviations


def whole(words):
    return sum(word << (64 * k) for k, word in enumerate(words))


@pytest.mark.parametrize("counter, key, expected", VECTORS)
def test_numpy_draws_the_published_vectors(counter, key, expected):
    """Its Philox counts up before the first draw."""
    source = np.random.Philox(counter=(whole(counter) - 1) % 2**256, key=whole(key))
    assert source.random_raw(4).tolist() == expected


def test_a_draw_is_of_its_key_and_counter():
    """Frame 6 of feature 3: key (seed, purpose), counter (6 + 1, 3, 0, 0)."""
    found = uniforms(ALL, Purpose.BLUNDER, (9, 5))[6, 3]
    source = np.random.Philox(counter=whole([6, 3, 0, 0]), key=whole([ALL, 2]))
    np.testing.assert_array_equal(found, [((bits >> 12) + 0.5) / 2**52 for bits in source.random_raw(4).tolist()])


def test_draws_do_not_depend_on_how_many_there_are():
    few, many = uniforms(5, Purpose.NOISE, (10, 3)), uniforms(5, Purpose.NOISE, (1000, 20))
    np.testing.assert_array_equal(few, many[:10, :3])
    assert uniforms(5, Purpose.NOISE, (0, 3)).shape == (0, 3, 4)


def test_uniforms():
    u = uniforms(7, Purpose.FATE, (2000, 25))
    assert u.min() > 0
    assert u.max() < 1
    assert stats.kstest(u.ravel(), "uniform").pvalue > 1e-6


def test_normals_are_normal_and_independent():
    z = standard_normals(11, Purpose.NOISE, (4000, 10))
    n = z.size
    assert stats.kstest(z.ravel(), "norm").pvalue > 1e-6
    assert (z**4).mean() == pytest.approx(3, abs=SIGMAS * np.sqrt(96 / n))
    covariance = np.cov(z.reshape(-1, 3).T)
    np.testing.assert_allclose(covariance, np.eye(3), atol=SIGMAS * np.sqrt(2 / (n / 3)))
    others = [z[1:] * z[:-1], z[:, 1:] * z[:, :-1], z * standard_normals(11, Purpose.ATTITUDE, (4000, 10))]
    others += [z * standard_normals(12, Purpose.NOISE, (4000, 10))]
    for product in others:
        assert abs(product.mean()) < SIGMAS / np.sqrt(product.size)


def test_the_normals_of_uniforms():
    """At (e⁻², 1/8, e⁻¹⁸, ½): lengths 2 and 6, angles 45° and 180°."""
    found = np.array(ca.evalf(normals_of(ca.SX([np.exp(-2.0), 0.125, np.exp(-18.0), 0.5])))).ravel()
    np.testing.assert_allclose(found, [np.sqrt(2), np.sqrt(2), -6.0], rtol=1e-15)

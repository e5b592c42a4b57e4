"""Patches are found where they are, in an image that is known between its pixels, too."""

import numpy as np
from scipy.stats import chi2

from baryscope.estimator.images.patches import HALF, MEAN_SQUARE, Patches, Places, Surface

SIZE = 200
RNG = np.random.default_rng(3)
WAVES = RNG.normal(0, 0.45, (60, 2))  # rad/px
PHASES = RNG.uniform(0, 2 * np.pi, 60)
MAP = np.stack(np.mgrid[:SIZE, :SIZE]).astype(np.float32)
A = np.array([[0.92, -0.21], [0.17, 1.06]])
SHIFT = np.array([3.37, -2.81])
MIDDLE = np.array([SIZE, SIZE]) / 2
CENTRES = np.stack(np.meshgrid(np.arange(40.0, 170, 30), np.arange(40.0, 170, 30)), axis=-1).reshape(-1, 2)


def texture(where):
    """Its values at places (…, 2), between about 40 and 160."""
    return 100 + 4 * np.cos(where @ WAVES.T + PHASES).sum(axis=-1)


def photo(noise, rng, warp=False, gain=1.0, offset=0.0, perspective=(0.0, 0.0)):
    """An image of 8 bits of the texture; with the warp, what is at x + middle is seen at A x / (1 + g·x) + middle +
    SHIFT, for a perspective g, px⁻¹.
    """
    pixels = MAP[::-1].transpose(1, 2, 0).astype(float)
    if warp:
        upright = (pixels - SHIFT - MIDDLE) @ np.linalg.inv(A).T
        pixels = upright / (1 - upright @ perspective)[..., None] + MIDDLE
    image = gain * texture(pixels) + offset + noise * rng.normal(size=(SIZE, SIZE))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def places():
    return Places((CENTRES - MIDDLE) @ A.T + MIDDLE + SHIFT, np.tile(A, (len(CENTRES), 1, 1)))


def found_in(noise, rng, start):
    patches = Patches.at(Surface.of(photo(noise, rng), MAP), CENTRES)
    return patches.found(Surface.of(photo(noise, rng, warp=True, gain=0.7, offset=20), MAP), start, 0.1)


def test_turned_stretched_and_in_other_light():
    """To what rounding to 8 bits, of 0.29 steps in 400 pixels of a slope of some 10 steps, lets be known: 0.003 px."""
    true, rng = places(), np.random.default_rng(1)
    start = Places(true.centre + rng.uniform(-1, 1, true.centre.shape), true.A + rng.uniform(-0.05, 0.05, true.A.shape))
    found = found_in(0.0, rng, start)
    assert found.there.all()
    np.testing.assert_allclose(found.places.centre, true.centre, atol=0.02)
    np.testing.assert_allclose(found.places.A, true.A, atol=0.01)


def test_patches_in_perspective_are_straightened():
    """A plane that leans by 45° more than before, seen by a lens of 800 px: about each centre p = A x / (1 + g·x) + c
    has an own A and g. Affine fits are off by g times the mean square of a patch, 37 px²; a tenth of that is left, of
    the next order and of rounding.
    """
    g, rng = np.array([1e-3, -0.8e-3]), np.random.default_rng(1)
    upright = CENTRES - MIDDLE
    weight = (1 + upright @ g)[:, None]
    centre, own = upright @ A.T / weight, g / weight
    true = Places(centre + MIDDLE + SHIFT, A / weight[..., None] - centre[:, :, None] * own[:, None])
    patches = Patches.at(Surface.of(photo(0.0, rng), MAP), CENTRES)
    found = patches.found(Surface.of(photo(0.0, rng, warp=True, perspective=g), MAP), true, 0.1)
    assert found.there.all()
    off, left = found.places.centre - true.centre, patches.straightened(found.places, own) - true.centre
    typical = np.linalg.norm(MEAN_SQUARE * A @ g)
    assert 0.6 * typical < np.linalg.norm(off, axis=1).mean() < 1.4 * typical
    assert np.linalg.norm(left, axis=1).mean() < 0.1 * typical
    assert np.linalg.norm(left.mean(axis=0)) < 0.02 * typical


def lens(stretch):
    """An image of the texture, stretched about the middle, by a lens whose blur is normal, of a pixel's deviation."""
    back = np.linalg.inv(stretch)
    pixels = (MAP[::-1].transpose(1, 2, 0) - MIDDLE) @ back.T + MIDDLE
    left = np.exp(-np.sum((WAVES @ back) ** 2, axis=1) / 2)
    return np.rint(100 + 6 * np.cos(pixels @ WAVES.T + PHASES) @ left).astype(np.uint8)


def test_patches_that_are_stretched_are_less_blurred():
    """Twice as long as wide: blur that the registration does not know of shifted each patch by 0.037 px rms."""
    stretch = np.diag([1.4, 0.7])
    true = Places((CENTRES - MIDDLE) @ stretch + MIDDLE, np.tile(stretch, (len(CENTRES), 1, 1)))
    found = Patches.at(Surface.of(lens(np.eye(2)), MAP), CENTRES).found(Surface.of(lens(stretch), MAP), true, 0.1)
    inside = ((true.centre > 2 * HALF) & (true.centre < SIZE - 2 * HALF)).all(axis=1)
    assert found.there[inside].all()
    assert np.sqrt(np.mean((found.places.centre - true.centre)[inside] ** 2)) < 0.01


def test_covariances_hold_what_noise_does():
    """Both images have the noise, the first one's the same for all time: the residuals have both, and so do errors."""
    errors = []
    for seed in range(12):
        found = found_in(3.0, np.random.default_rng(seed), places())
        error = found.places.centre - places().centre
        errors.append(np.einsum("ki,kij,kj->k", error, np.linalg.inv(found.covariance), error)[found.there])
    squares = np.concatenate(errors)
    assert squares.size > 250
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 2 * squares.size) / squares.size
    assert 0.9 * low < squares.mean() < 1.1 * high  # the covariance is of first order, and the image's scale is not 1


def test_what_is_not_there_is_not_found():
    true, rng = places(), np.random.default_rng(1)
    other = Places(np.roll(true.centre, 1, axis=0), true.A)
    assert not found_in(0.0, rng, other).there.any()
    edge = Patches.at(Surface.of(photo(0, rng), MAP), CENTRES[:1])
    outside = edge.found(Surface.of(photo(0, rng), MAP), Places.upright(np.array([[HALF - 3.0, 50.0]])), 0.1)
    assert not outside.there.any()

import numpy as np

from baryscope.estimator.adjustment.spurious import spurious_information_columns


def test_spurious_information_is_subtracted():
    """Against the inverse of the joint information of offset and other unknowns less the spurious information."""
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(7, 7))
    joint = factor @ factor.T
    offset, crossed, others = joint[:3, :3], joint[:3, 3:], joint[3:, 3:]
    values, axes = np.linalg.eigh(np.linalg.inv(offset))
    spurious = (axes * (values * [0.9, 0.5, 0.0])) @ axes.T
    information = np.linalg.inv(joint)
    information[:3, :3] -= spurious
    expected = np.linalg.inv(information)
    columns, gain = spurious_information_columns(offset, crossed, spurious, 1e-9)
    np.testing.assert_allclose(offset + columns @ columns.T, expected[:3, :3], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(others + gain @ gain.T, expected[3:, 3:], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(crossed + columns @ gain.T, expected[:3, 3:], rtol=1e-9, atol=1e-9)

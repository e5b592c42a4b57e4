"""Rotations: the information that turns pretend to give, against its definition by finite rotations."""

import numpy as np

from baryscope.estimator.geometry.so3 import turned_information


def test_turned_information_is_the_mean_over_turns():
    """Turns φ = ±√3 aᵢ, each as likely, with C = Σ aᵢ aᵢᵀ: the mean of the information on d in φ × d is exact."""
    rng = np.random.default_rng(4)
    n = 3
    roots = rng.normal(size=(n, 3, 3))
    information = np.array([a @ a.T for a in rng.normal(size=(n, 3, 3))])
    expected = np.zeros((3, 3))
    for Q, root in zip(information, roots, strict=True):
        for phi in np.sqrt(3) * root.T:
            by_d = np.cross(phi, np.eye(3)).T  # columns φ × eᵢ
            expected += by_d.T @ Q @ by_d / 3
    found = turned_information(information, roots @ np.swapaxes(roots, 1, 2))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)

"""Bodies that can be."""

import numpy as np

from baryscope.study.population.fourth.bodies import CLOSEST, FEWEST, MASSES, MOST, MOST_CLUSTERS, drawn, drawn_mass

BODIES = [drawn(np.random.default_rng(seed)) for seed in range(300)]


def test_every_shape_occurs():
    shapes = {"shell", "one end", "outside", "planar", "ring", "boom", "box", "blob"}
    assert {body.shape for body in BODIES} == shapes


def test_features_are_apart_in_clusters_that_face_one_way():
    for body in BODIES:
        assert FEWEST <= len(body.points) == len(body.cluster) <= MOST
        assert body.cluster.max() < MOST_CLUSTERS
        distance = np.linalg.norm(body.points[:, None] - body.points, axis=2) + np.eye(len(body.points))
        assert distance.min() >= CLOSEST
        assert body.reach >= body.radius / 2
        if body.normals is not None:
            np.testing.assert_allclose(np.linalg.norm(body.normals, axis=1), 1)
            assert body.cluster.max() < len(body.normals)


def test_those_at_one_end_are_to_one_side_of_the_centre_of_mass():
    """0.8 sizes from it at least, less three deviations of 0.3 · 0.6 · 0.7 sizes."""
    found = [body for body in BODIES if body.shape == "one end" and body.normals is not None]
    assert len(found) > 20
    for body in found:
        assert body.points[:, 2].mean() > 0.4 * body.size


def test_those_in_a_plane_are_in_one():
    for body in BODIES:
        if body.shape == "planar":
            assert np.linalg.svd(body.points - body.points.mean(axis=0))[1][2] < 1e-9


def test_an_inertia_is_one_of_positive_masses():
    masses = [drawn_mass(np.random.default_rng(seed)) for seed in range(100)]
    assert {mass.kind for mass in masses} == set(MASSES)
    for mass in masses:
        least, middle, greatest = np.linalg.eigvalsh(mass.inertia)
        assert 0 < greatest < least + middle
        principal = mass.axes.T @ mass.inertia @ mass.axes
        np.testing.assert_allclose(principal, np.diag(np.diag(principal)), atol=1e-12)
        assert np.linalg.det(mass.axes) > 0

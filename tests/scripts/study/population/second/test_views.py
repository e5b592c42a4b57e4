"""Runs of frames, and the labels that a tracker gives them."""

import numpy as np

from baryscope.study.population.second.cases import drawn
from baryscope.study.population.second.views import facing, runs, short_lives

RELABELLED, SHORT = (1, 24), (1, 35)


def test_runs_are_those_of_each_feature_by_their_begin():
    seen = np.array([[1, 0], [1, 1], [0, 1], [1, 1]], dtype=bool)
    assert runs(seen) == [(0, 0, 2), (1, 1, 4), (0, 3, 4)]


def test_short_lives_are_within_what_faces_the_chaser():
    rng = np.random.default_rng(3)
    faces = rng.random((200, 12)) < 0.9
    found = short_lives(rng, faces, 5, 10)
    busy = np.zeros((200, 12), dtype=int)
    for feature, begin, end in found:
        assert faces[begin:end, feature].all()
        busy[begin:end, feature] += 1
    assert busy.max() == 1
    assert busy.sum(axis=1).max() == 5


def test_a_feature_faces_the_chaser_by_its_normal():
    points = np.tile([0.0, 0.0, 10.0], (1, 3, 1))
    normals = np.array([[[0.0, 0, -1], [0, 0, 1], [0, 0, 0]]])
    assert facing(points, normals, 0.2).tolist() == [[True, False, True]]


def test_a_label_is_one_point_of_the_body():
    """Many labels, of runs of a few points: right observations lie about the point of theirs, as wide as the noise."""
    for key in (RELABELLED, SHORT):
        case = drawn(*key)
        tracks, right = case.sample.tracks, case.sample.right
        assert len(tracks.labels) > 3 * len(np.unique(case.feature))
        assert np.array_equal(tracks.seen, case.seen)
        place = np.einsum("nji,nmj->nmi", case.attitude, tracks.position - case.path[:, None])
        off = np.einsum("nij,nmj->nmi", case.attitude, place - case.points)[right]
        assert np.sqrt(np.einsum("ki,kij,kj->k", off, case.sample.precision[right], off)).max() < 6

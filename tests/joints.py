"""Recordings of two bodies that turn about a joint while both move, as a shoulder or a knee does."""

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from baryscope.estimator.tracks import FeatureTracks

TIME = np.arange(600) / 50.0
TRUTH = np.array([0.02, -0.03, -0.2])  # of the joint, in the child's axes, from its origin
SHAPE = np.array([[0.1, 0.0, 0.0], [-0.08, 0.09, 0.0], [-0.07, -0.08, 0.03], [0.0, 0.02, 0.11]])


def recording(rng, sigma, memory, hinge=False):
    """Tracks of parent and child, and the true joint in the tracks' axes. memory: of an AR(1) noise of each segment."""
    t = TIME[:, None]
    turn = 0.7 * np.sin(2 * np.pi * np.array([0.31, 0.47, 0.23]) * t + [0, 1, 2])
    bend = 0.8 * np.sin(2 * np.pi * np.array([0.53, 0.37, 0.71]) * t + [2, 0, 1]) * ([1, 0, 0] if hinge else [1, 1, 1])
    R_T_P = Rotation.from_rotvec(turn).as_matrix()
    R_T_C = R_T_P @ Rotation.from_rotvec(bend).as_matrix()
    origin = np.array([0.5, 0.1, 1.0]) + 0.1 * np.sin(t + np.arange(3))
    centre = origin + R_T_P @ [0.1, 0.2, 0.3]
    tracks = []
    for R, place in ((R_T_P, origin), (R_T_C, centre - R_T_C @ TRUTH)):
        points = place[:, None] + SHAPE @ np.swapaxes(R, 1, 2)
        white = rng.normal(size=(len(TIME) + 500, 3)) * sigma * np.sqrt(1 - memory**2)
        skin = lfilter([1], [1, -memory], white, axis=0)[500:]  # in the body's axes, all markers together
        points = points + np.einsum("kij,kj->ki", R, skin)[:, None]
        points = points + rng.normal(size=points.shape) * sigma / 4
        tracks.append(FeatureTracks(TIME, points, tuple("abcd")))
    return *tracks, centre


def both_bodies(seed, hinge=False):
    """A recording with 1 mm of noise as one set of tracks: pa … pd on the parent, ca … cd on the child."""
    parent, child, _ = recording(np.random.default_rng(seed), 0.001, 0.5, hinge)
    labels = (*(f"p{name}" for name in parent.labels), *(f"c{name}" for name in child.labels))
    return FeatureTracks(TIME, np.concatenate([parent.position, child.position], axis=1), labels)


def restricted(design, covariance, wanted):
    """The unknowns (..., p) by generalised least squares, their covariance, and the logarithm of the restricted
    likelihood, for covariances (..., n, n) of what is wanted, (n,).
    """
    solved = np.linalg.solve(covariance, np.column_stack([design, wanted]))
    information = design.T @ solved[..., :-1]
    found = np.linalg.solve(information, (design.T @ solved[..., -1:]))[..., 0]
    left = wanted - found @ design.T
    square = np.sum(left * np.linalg.solve(covariance, left[..., None])[..., 0], axis=-1)
    logarithm = -0.5 * (np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(information)[1] + square)
    return found, np.linalg.inv(information), logarithm

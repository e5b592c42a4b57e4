"""A symmetric top as tests of the online estimator watch it: closed-form motion, and what a batch would know of it.

It precesses about z, with a tilt, and spins about its axis; its centre of mass moves in a straight line unless a test
has another path. Nothing of it is shared with the filter.
"""

import numpy as np
from scipy.spatial.transform import Rotation

SIGMA = 0.02  # m
POINTS = np.array(
    [
        [2.0, 1.4, -1.2],
        [-2.1, -1.4, 0.9],
        [1.9, 1.0, 0.9],
        [0.9, -1.4, -1.2],
        [-1.1, 1.4, -1.2],
        [-1.2, -0.4, 1.3],
        [0.3, 0.2, 1.6],
        [2.4, -0.6, 0.2],
    ]
)
START, DRIFT = np.array([3.0, 18.0, -4.0]), np.array([0.02, -0.01, 0.015])
TURN = 120.0  # s, of the precession
FRAMES = 180


def attitudes(time):
    """R_C_B (n, 3, 3) of a symmetric top."""
    turn = 2 * np.pi * time / TURN
    angles = np.stack([turn, np.full_like(turn, 0.7), 0.6 * turn], axis=1)
    return Rotation.from_euler("ZXZ", angles).as_matrix()


def tracks(rng, time, path, points=POINTS, sigma=SIGMA):
    places = path[:, None] + points @ np.swapaxes(attitudes(time), 1, 2)
    return places + sigma * rng.standard_normal(places.shape)


def two_sides(rng, time, path, turn):
    """Tracks (n, 2 m, 3) of a target that shows one half of its features up to frame `turn`, then the other."""
    seen = tracks(rng, time, path, np.concatenate([POINTS, -0.7 * POINTS]))
    seen[:turn, len(POINTS) :] = np.nan
    seen[turn:, : len(POINTS)] = np.nan
    return seen


def straight(time):
    return START + time[:, None] * DRIFT


def run(filter, time, seen, **more):
    return [filter.update(float(t), frame, **more) for t, frame in zip(time, seen, strict=True)]


def errors(states, path):
    """Distances (n,) and NEES (n,) of states."""
    off = np.array([state.position for state in states]) - path
    of_place = np.array([state.covariance[:3, :3] for state in states])
    return np.linalg.norm(off, axis=1), np.einsum("ni,nij,nj->n", off, np.linalg.inv(of_place), off)


def batch_bound(time):
    """The rms error of least squares on all frames, at the last: position, velocity and offset, known attitudes."""
    t = (time - time[-1])[:, None, None]
    design = np.concatenate([np.tile(np.eye(3), (len(time), 1, 1)), t * np.eye(3), attitudes(time)], axis=2)
    information = np.einsum("nki,nkj->ij", design, design) * len(POINTS) / SIGMA**2
    return np.sqrt(np.trace(np.linalg.inv(information)[:3, :3]))

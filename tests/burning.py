"""The path of the centre of mass as seen from a chaser that burns: both bodies in inertial axes, by DOP853."""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from baryscope.estimator.tracks import FeatureTracks
from synthetic import ENVISAT, MU, Orbit, attitude, box_features, rig_tracks


def axes(r, v):
    """R_I_L: radial, along the track, normal to the orbit."""
    normal = np.cross(r, v) / np.linalg.norm(np.cross(r, v))
    radial = r / np.linalg.norm(r)
    return np.stack([radial, np.cross(normal, radial), normal], axis=1)


def path_with_burns(time, burns, offset=(0.0, -20.0, 3.0)):
    """Positions (n, 3) of the target from the chaser in I, m; burns: (begin, end, change of velocity (3,) in LVLH).

    The chaser starts at `offset` in LVLH, m, at rest in it.
    """
    orbit = Orbit()
    R = orbit.R_I_L(np.zeros(1))[0]
    p = orbit.semi_major_axis * (1 - orbit.eccentricity**2)
    e, nu = orbit.eccentricity, orbit.anomaly
    radius = p / (1 + e * np.cos(nu))
    r = radius * R[:, 0]
    v = np.sqrt(MU / p) * (e * np.sin(nu) * R[:, 0] + (1 + e * np.cos(nu)) * R[:, 1])
    turning = np.cross(np.cross(r, v) / radius**2, R @ np.array(offset))
    state = np.concatenate([r, v, R @ np.array(offset), turning])

    def slope(_, y, push):
        r, v, d = y[:3], y[3:6], y[6:9]
        # r/|r|³ − c/|c|³ for a chaser at c = r + d without the difference of large numbers (Battin's f(q)).
        q = d @ (d + 2 * r) / (r @ r)
        f = q * (3 + 3 * q + q * q) / (1 + (1 + q) ** 1.5)
        pull = -MU / np.linalg.norm(r) ** 3 * (d - f / (1 + q) ** 1.5 * (r + d))
        return np.concatenate([v, -MU * r / np.linalg.norm(r) ** 3, y[9:], pull + axes(r, v) @ push])

    edges = np.unique([0.0, time[-1], *(edge for begin, end, _ in burns for edge in (begin, end) if edge < time[-1])])
    found = np.empty((len(time), 3))
    for first, last in pairwise(edges):
        on = [np.array(change) / (end - begin) for begin, end, change in burns if begin <= first < end]
        push = sum(on, np.zeros(3))
        here = (time >= first) & (time <= last)
        part = solve_ivp(slope, (first, last), state, "DOP853", args=(push,), rtol=1e-12, atol=1e-11, dense_output=True)
        if here.any():
            found[here] = -part.sol(time[here])[6:9].T
        state = part.y[:, -1]
    return found


def tracks_of_faces(time, com, rate, count, *, seed, baseline):
    """Tracks of a tumbling box by a rig of a baseline in m, which sees the features of the faces that look at it.

    com (n, 3): the path of the centre of mass, which is not that of the box; rate: angular rate at first, deg/s.
    """
    size, centre = np.array([8.0, 3.0, 3.0]), np.array([0.8, 0.5, -0.4])
    features, R = box_features(count, tuple(size), seed, tuple(centre)), attitude(ENVISAT, np.deg2rad(rate), time)
    tracks = rig_tracks(time, R, com, features, seed=seed, baseline=baseline)
    on_box = (features - centre) / (size / 2)
    face = np.argmax(np.abs(on_box), axis=1)
    normals = np.zeros_like(features)
    normals[np.arange(count), face] = np.sign(on_box[np.arange(count), face])
    sight = -(com[:, None] + np.einsum("nij,mj->nmi", R, features))
    sight /= np.linalg.norm(sight, axis=2, keepdims=True)
    seen = np.einsum("nmi,nmi->nm", np.einsum("nij,mj->nmi", R, normals), sight) > 0.15
    position = np.where(seen[..., None], tracks.position, np.nan)
    covariance = np.where(seen[..., None, None], tracks.covariance, np.nan)
    return FeatureTracks(time, position, tracks.labels, covariance)

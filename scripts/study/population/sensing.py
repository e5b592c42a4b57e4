"""The tracks of a case: noise, a stereo rig's triangulation, dropouts, blunders and wrong labels."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator import FeatureTracks
from baryscope.study.population.cases import FOCAL_LENGTH, Case
from baryscope.study.population.interface import Sample

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def sampled(case: Case, draw: int = 0) -> Sample:
    """The tracks of a case, from its seed and index alone; draw: another number gives other noise and blunders."""
    rng = np.random.default_rng(np.random.SeedSequence([case.seed, case.index, 1, draw]))
    n, m = case.seen.shape
    noise = rng.standard_normal((n, m, 3))
    kept = case.seen & (rng.random((n, m)) >= case.sensor.dropout)
    true = case.path[:, None] + case.points @ np.swapaxes(case.attitude, 1, 2)
    labels = _labels(case, kept, rng)
    frame = np.arange(n)[:, None]
    true = true[frame, labels]
    wrong = rng.random((n, m)) < case.sensor.outliers
    blunder = rng.standard_normal((n, m, 3))
    blunder *= case.sensor.blunder * rng.random((n, m, 1)) / np.linalg.norm(blunder, axis=2, keepdims=True)
    moved = true + np.where(wrong[..., None], blunder, 0.0)
    covariance = None
    if case.sensor.baseline:
        position, covariance, precision = _stereo(case, moved, noise)
        kept &= np.isfinite(position).all(axis=2)
        covariance = np.where(kept[..., None, None], covariance, np.nan)
    else:
        position = moved + case.sensor.noise * noise
        precision = np.broadcast_to(np.eye(3) / case.sensor.noise**2, (n, m, 3, 3))
    position = np.where(kept[..., None], position, np.nan)
    tracks = FeatureTracks(case.time, position, [f"F{k}" for k in range(m)], covariance)
    return Sample(tracks, kept & ~wrong & (labels == np.arange(m)), precision)


def _labels(case: Case, kept: BoolArray, rng: np.random.Generator) -> NDArray[np.intp]:
    """Which feature (n, m) is behind each label: pairs that are in view change labels, for a frame or a stretch."""
    n, m = kept.shape
    labels = np.tile(np.arange(m), (n, 1))
    frames = np.nonzero(rng.random(n) < case.sensor.swapped * m / 2)[0]
    stretch = np.empty(0, dtype=np.intp)
    pair = rng.permutation(m)[:2]
    if case.sensor.mislabelled:
        begin, length = int(rng.integers(0, n)), max(1, round(n * rng.uniform(0.05, 0.4)))
        stretch = np.arange(begin, min(begin + length, n))
        labels[stretch[:, None], pair] = pair[::-1]
    for k in frames:
        visible = np.nonzero(kept[k])[0]
        if len(visible) > 1 and k not in stretch:
            two = rng.permutation(visible)[:2]
            labels[k, two] = two[::-1]
    return labels


def _stereo(case: Case, points: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Triangulated positions, their covariances at the measured point, and the precision at the true one, all in C.

    A rectified pair that points at the centre of mass: u_l = f X/Z, v = f Y/Z, u_r = f (X − B)/Z.
    """
    f, base, sigma = FOCAL_LENGTH, case.sensor.baseline, case.sensor.noise
    ahead = case.path / np.linalg.norm(case.path, axis=1, keepdims=True)
    side = np.cross(ahead, np.eye(3)[np.abs(ahead).argmin(axis=1)])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    R_C_V = np.stack([side, np.cross(ahead, side), ahead], axis=2)
    X, Y, Z = np.moveaxis(points @ R_C_V, 2, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = np.stack([f * X / Z, f * Y / Z, f * (X - base) / Z], axis=2) + sigma * noise
        pixels[(Z <= 0) | (pixels[..., 0] <= pixels[..., 2])] = np.nan
        depth = base * f / (pixels[..., 0] - pixels[..., 2])
    place = np.stack([depth * pixels[..., 0] / f, depth * pixels[..., 1] / f, depth], axis=2)
    turn = R_C_V[:, None]

    def covariance(at: FloatArray) -> FloatArray:
        """J Jᵀ σ²: Z = f B / d with d = u_l − u_r, X = B u_l / d, Y = B v / d."""
        x, y, z = np.moveaxis(at, 2, 0)
        d = f * base / z
        zero = np.zeros_like(z)
        by_left = np.stack([z / f - x / d, -y / d, -z / d], axis=2)
        by_v = np.stack([zero, z / f, zero], axis=2)
        by_right = np.stack([x, y, z], axis=2) / d[..., None]
        J = turn @ np.stack([by_left, by_v, by_right], axis=3) * sigma
        return np.asarray(J @ np.swapaxes(J, 2, 3))

    truth = np.stack([X, Y, np.where(Z > 0, Z, 1.0)], axis=2)
    position = np.einsum("nij,nmj->nmi", R_C_V, place)
    return position, covariance(place), np.asarray(np.linalg.inv(covariance(truth)))

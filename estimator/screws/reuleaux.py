"""The generalised Reuleaux rule: the screw of a displacement from points before and after it, equation (8)."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.screws.screws import (
    DEGENERATE_POINTS,
    SOUND,
    TOO_FEW_POINTS,
    TOO_LITTLE_ROTATION,
    Screws,
    screws_or_nan,
)

FloatArray = NDArray[np.float64]


def reuleaux(before: FloatArray, after: FloatArray, weights: FloatArray, deviation: FloatArray | float = 0.0) -> Screws:
    """Screws of n displacements from k >= 3 points each: before, after (n, k, 3) in m, weights (n, k), 0 = not seen.

    The differences of the displacements lie in the plane normal to the axis. The axis is the direction in which they
    vary least; for three points this is c₁ × c₂. The pole is the least-squares intersection of the perpendicular
    bisectors of the projected chords. The axis has the sense of the rotation, so that the angle is in [0, π].

    `deviation`, a number or (n,), is the standard deviation of a coordinate in m. Screws whose displacements are not
    significant have a status other than SOUND; this includes parallel chords, as their differences are parallel.
    """
    present = weights > 0
    w = np.where(present, weights, 0.0)
    total = np.maximum(w.sum(axis=1), 1e-300)
    p = np.where(present[..., None], before, 0.0)
    q = np.where(present[..., None], after, 0.0)
    centre_p, centre_q = _mean(w, p, total), _mean(w, q, total)
    origin = 0.5 * (centre_p + centre_q)
    arm_p, arm_q = p - centre_p[:, None], q - centre_q[:, None]
    scale = np.einsum("nk,nki,nki->n", w, arm_p, arm_p) / total + np.einsum("nk,nki,nki->n", w, arm_q, arm_q) / total
    # Mean square of three standard deviations of a difference of two positions, or the rounding of the eigenvalues.
    noise = np.maximum(2 * (3.0 * np.asarray(deviation)) ** 2, 1e-14 * scale)

    difference = arm_q - arm_p
    spread, directions = np.linalg.eigh(_moment(w, difference, total))
    axis = directions[:, :, 0]
    sine, cosine = _rotation(w, arm_p, arm_q, axis)
    axis = np.where((sine < 0)[:, None], -axis, axis)
    angle = np.arctan2(np.abs(sine), cosine)

    chord, middle = q - p, 0.5 * (p + q) - origin[:, None]
    chord = chord - np.einsum("nki,ni->nk", chord, axis)[..., None] * axis[:, None]
    normal = _moment(w, chord, total)
    rhs = np.einsum("nk,nki->ni", w * np.einsum("nki,nki->nk", chord, middle), chord) / total[:, None]
    offset = _solve_in_plane(normal, rhs, axis)
    translation = np.einsum("ni,ni->n", axis, centre_q - centre_p)

    status = np.full(len(p), SOUND)
    status[spread[:, 1] <= noise] = DEGENERATE_POINTS
    status[spread[:, 2] <= noise] = TOO_LITTLE_ROTATION
    status[present.sum(axis=1) < 3] = TOO_FEW_POINTS
    return screws_or_nan(axis, origin + offset, angle, translation, status)


def _mean(w: FloatArray, points: FloatArray, total: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nk,nki->ni", w, points) / total[:, None])


def _moment(w: FloatArray, vectors: FloatArray, total: FloatArray) -> FloatArray:
    return np.asarray(np.swapaxes(vectors * w[..., None], 1, 2) @ vectors / total[:, None, None])


def _rotation(w: FloatArray, arm_p: FloatArray, arm_q: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of the arms' rotation about the axis (n, 3), times a common factor."""
    sine = np.einsum("nk,nki,ni->n", w, np.cross(arm_p, arm_q), axis)
    along = np.einsum("nki,ni->nk", arm_p, axis) * np.einsum("nki,ni->nk", arm_q, axis)
    cosine = np.einsum("nk,nk->n", w, np.einsum("nki,nki->nk", arm_p, arm_q) - along)
    return sine, cosine


def _solve_in_plane(normal: FloatArray, rhs: FloatArray, axis: FloatArray) -> FloatArray:
    """Solve normal @ x = rhs (n, 3) for x normal to the axis.

    `normal` (n, 3, 3) has the axis as a null vector; in the plane its inverse is (tr·1 − N)/det₂.
    """
    trace = np.einsum("nii->n", normal)
    determinant = 0.5 * (trace**2 - np.einsum("nij,nij->n", normal, normal))
    solution = trace[:, None] * rhs - np.einsum("nij,nj->ni", normal, rhs)
    solution = solution / np.where(determinant > 0, determinant, 1.0)[:, None]
    return np.asarray(solution - np.einsum("ni,ni->n", solution, axis)[:, None] * axis)

"""Spurious information: apparent information from the noise of estimated attitudes, removed from a covariance."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import pieces
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import symmetric_inverses
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

FARTHEST_RADII = 3.0  # standard deviation of a centre of mass that is not observed, in radii of the features
FRAMES = 3000  # frames of a body from which its spurious information is computed, approximately


def three_sigma_factor(values: int) -> float:
    """The 3σ bound of a mean of squares of Gaussian values over its expectation, for the number of values."""
    return float(1 + 3 * np.sqrt(2 / values))


def farthest(points: FloatArray) -> float:
    """The standard deviation, m, of the centre of mass in a direction that is not observed, for points (m, 3) from it.

    That is FARTHEST_RADII of the points about their centroid, or the distance to which spurious information has led.
    """
    centroid = points.mean(axis=0)
    radius = np.sqrt(np.mean(np.sum((points - centroid) ** 2, axis=1)))
    return float(max(FARTHEST_RADII * radius, np.linalg.norm(centroid), 1e-150))


def spurious_information_columns(
    offset: FloatArray, crossed: FloatArray, spurious: FloatArray, least: float
) -> tuple[FloatArray, FloatArray]:
    """The increase of a joint covariance by spurious information.

    The noise of the attitudes does not make the cost steeper, on average, so that the information I of Gauss and Newton
    is too large by the spurious S; and it adds S to the variance of the cost's gradient. The variance is that of an
    estimating equation, (I − S)⁻¹ I (I − S)⁻¹, in each principal direction of I.

    offset (k, k): covariance of the offsets; crossed (k, p): their covariance with the other unknowns; spurious (k, k):
    the information on the offsets to subtract; least: the least information in a direction.
    Returns columns A of the offsets (k, k) and B of the other unknowns (p, k): the covariances grow by A Aᵀ and B Bᵀ,
    the cross-covariance by A Bᵀ.
    """
    information = np.linalg.pinv(offset, hermitian=True)
    values, axes = np.linalg.eigh(information)
    seen = values > 0
    informed = np.where(seen, values, 1.0)
    remaining = np.maximum(values - np.einsum("ik,ij,jk->k", axes, spurious, axes), np.sqrt(informed * least))
    increase = np.where(seen, informed / np.where(seen, remaining, 1.0) ** 2 - 1 / informed, 0.0)
    columns = axes * np.sqrt(np.maximum(increase, 0.0))
    return columns, crossed.T @ information @ columns


def likely_spurious_information(
    body: Body, observations: Observations, origin: FloatArray, variance: float, shift: FloatArray | None = None
) -> FloatArray:
    """The spurious information (3, 3) on a body's offset with a margin of three standard deviations."""
    expected = spurious_information(body, observations, origin, variance, shift)
    return three_sigma_factor(len(body.frames)) * expected


def spurious_information(
    body: Body,
    observations: Observations,
    origin: FloatArray,
    variance: float,
    shift: FloatArray | None = None,
) -> FloatArray:
    """The spurious information (3, 3) in S on a body's offset from the noise of its attitudes, in the weights' units.

    An attitude error φ changes the offset d in C by φ × d. With C the covariance of φ and Q the frame's information on
    its position with the attitude unknown, the expected information is Σ tr([eᵢ]×ᵀ Q [eⱼ]× C). The next order of φ adds
    a share of about the greatest variance of φ, in rad². An attitude that is not known at all is off by a radian or
    two, so that C is bounded by (1 + C⁻¹)⁻¹.
    origin (n, 3): the path in C, m; variance: of an observation of weight 1; shift (n, 3, 3): the covariance of the
    frames' shifts in C over that variance.
    """
    every = max(1, len(body.frames) // FRAMES)
    frames, attitude = body.frames[::every], body.attitude[::every]
    found = pieces(observations.frames(frames).features(body.features), attitude, origin[frames], body.points)
    known, _ = found.shift_alone()
    if shift is not None:
        noise = np.swapaxes(attitude, 1, 2) @ shift[frames] @ attitude
        known = known @ np.linalg.inv(np.eye(3) + noise @ known)
    axes = cross_matrices(np.eye(3))
    values, vectors = np.linalg.eigh(variance * symmetric_inverses(found.turn))
    values /= 1 + values
    turned = (1 + values[:, -1:, None]) * (vectors * values[:, None]) @ np.swapaxes(vectors, 1, 2)
    return np.asarray(every * np.einsum("iba,kbc,jcd,kda->ij", axes, known, axes, turned, optimize=True))

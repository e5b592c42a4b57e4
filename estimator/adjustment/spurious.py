"""Spurious information: apparent information from the noise of estimated attitudes, removed from a covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import pieces
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.dynamics.paths import SampledPath
from baryscope.estimator.geometry.so3 import cross_matrices, turned_information
from baryscope.estimator.geometry.symmetric import symmetric_inverses
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

FARTHEST_RADII = 3.0  # standard deviation of a centre of mass that is not observed, in radii of the features
FRAMES = 3000  # frames of a body from which its spurious information is computed, approximately
RANK = 1e-14  # of a covariance's greatest value: less is a direction that is fixed


@dataclass(frozen=True, eq=False)
class ProductNoise:
    """What `product_gradient` needs of noise: offset (3, 3), the covariance of the body's offset in S, m²; variance of
    an observation of weight 1; shift (n, 3, 3) or None: the covariance of the frames' shifts in C over that variance.
    """

    offset: FloatArray
    variance: float
    shift: FloatArray | None = None


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
    estimating equation, (I − S)⁻¹ I (I − S)⁻¹, but in no direction greater than that of the least information.

    offset (3 k, 3 k): covariance of k offsets; crossed (3 k, p): their covariance with the other unknowns; spurious
    (3 k, 3 k): the information on the offsets to subtract; least: the least information on an offset in a direction.
    Returns columns A of the offsets (3 k, d) and B of the other unknowns (p, d): the covariances grow by A Aᵀ and B Bᵀ,
    the cross-covariance by A Bᵀ.
    """
    values, axes = np.linalg.eigh((offset + offset.T) / 2)
    seen = values > RANK * values[-1]
    root = axes[:, seen] * np.sqrt(values[seen])
    share, along = np.linalg.eigh(root.T @ spurious @ root)
    directions = root @ along  # of one standard deviation each
    length = np.sqrt((directions.reshape(-1, 3, directions.shape[1]) ** 2).sum(axis=1).max(axis=0))
    remaining = np.maximum(1 - share, np.minimum(length * np.sqrt(least), 1.0))
    columns = directions * np.sqrt(np.maximum(remaining**-2.0 - 1, 0.0))
    return columns, crossed.T @ np.linalg.pinv(offset, hermitian=True) @ columns


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
    a share of about the greatest variance of φ, in rad².
    origin (n, 3): the path in C, m; variance: of an observation of weight 1; shift (n, 3, 3): the covariance of the
    frames' shifts in C over that variance.
    """
    noise = _FrameNoise.of(body, observations, origin, variance, shift)
    turned = (1 + noise.variances[:, -1:, None]) * noise.of_attitude
    return noise.every * turned_information(noise.known, turned)


def product_gradient(
    body: Body, observations: Observations, path: SampledPath, x: FloatArray, noise: ProductNoise
) -> FloatArray:
    """The variance (3 + p, 3 + p) of the cost's gradient by offset and x from products of errors, in squared weights.

    Where the offset is off by δ, an attitude error φ moves a frame by φ × δ, which is of second order and no residual
    of the solution shows. With P the covariance of δ and C that of φ, it is Σ Aᵀ Q Γ Q A, Γ = Σ Pᵢⱼ [eᵢ]× C [eⱼ]×ᵀ, A
    the Jacobian of the frame's position in S by offset and x.
    """
    own = _FrameNoise.of(body, observations, path.position(x), noise.variance, noise.shift)
    axes = cross_matrices(np.eye(3))
    moved = np.einsum("ij,iab,kbc,jdc->kad", noise.offset, axes, own.of_attitude, axes, optimize=True)
    weight = own.known @ moved @ own.known
    turned = own.attitude @ weight
    by_x = path.gram(own.frames, turned @ np.swapaxes(own.attitude, 1, 2))
    crossed = path.moment(own.frames, turned)
    return np.asarray(own.every * np.block([[weight.sum(axis=0), crossed.T], [crossed, by_x]]))


@dataclass(frozen=True, eq=False)
class _FrameNoise:
    """What noise does to a body's frames, of which each of `every` is taken: frames (n,), and attitude (n, 3, 3).

    known (n, 3, 3): the information Q on the frame's position in S, with the attitude unknown; of_attitude (n, 3, 3):
    the covariance C of the attitude, rad², and variances (n, 3) along its principal axes, ascending. An attitude that
    is not known at all is off by a radian or two, so that C is bounded by (1 + C⁻¹)⁻¹.
    """

    every: int
    frames: IntArray
    attitude: FloatArray
    known: FloatArray
    of_attitude: FloatArray
    variances: FloatArray

    @classmethod
    def of(
        cls, body: Body, observations: Observations, origin: FloatArray, variance: float, shift: FloatArray | None
    ) -> "_FrameNoise":
        """Arguments as in `spurious_information`."""
        every = max(1, len(body.frames) // FRAMES)
        frames, attitude = body.frames[::every], body.attitude[::every]
        found = pieces(observations.frames(frames).features(body.features), attitude, origin[frames], body.points)
        known, _ = found.shift_alone()
        if shift is not None:
            noise = np.swapaxes(attitude, 1, 2) @ shift[frames] @ attitude
            known = known @ np.linalg.inv(np.eye(3) + noise @ known)
        values, vectors = np.linalg.eigh(variance * symmetric_inverses(found.turn))
        values /= 1 + values
        covariance = (vectors * values[:, None]) @ np.swapaxes(vectors, 1, 2)
        return cls(every, frames, attitude, known, covariance, values)

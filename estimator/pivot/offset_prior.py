"""What is known of a centre of mass before anything turns: it is about where the features are.

Each body's offset, its features' centroid from the centre of mass, has a Gaussian prior of mean zero, as wide as twice
the features' rms radius along each axis. Where the tracks tell the offset, this changes next to nothing. Where they do
not, as along the axis of a spin, solutions would else go wherever noise leads them.

Features are on one side of an object in all bodies alike. So the bodies share one prior, each by its frames: together
they do not know the centre of mass any better.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

RADII = 2.0  # standard deviation of each coordinate of the offset, in the rms radius of very many features
LEAST = 1e-3  # information of the tracks over that of the prior: less is as good as none
RANK = 1e-12  # of variances: across the plane of a line and the centre of mass there is none
NOTICEABLE = 1e-4  # information of the prior over that of the tracks, from which spurious information matters to it
CONTRADICTED = 15.0  # increase of the squared residuals over their variance where offsets are held, which noise is not
DEVIATIONS = 3.0  # of the noise of the sum of squares from one place to another
NOISIER = 1.5  # spurious information over that where offsets are told
MOST_TIMES, TOLERANCE = 3, 0.5  # how often what holds firmly is found anew, and the relative change for which it is


def a_priori_information(bodies: Sequence[Body]) -> FloatArray:
    """The information (k,) on each coordinate of the offsets of k bodies, 1/m²."""
    radius = max(max(radius_of_many(body.points) for body in bodies), 1e-150)
    frames = np.array([len(body.frames) for body in bodies], dtype=np.float64)
    return np.asarray(frames / frames.sum() / (RADII * radius) ** 2)


def radius_of_many(points: FloatArray) -> float:
    """The rms radius, m, that very many features may have of which some are at points (m, 3).

    About their centroid the mean square is (m − 1)/m of the variance. Of ν = 3 (m − 1) values of variance τ² the
    inverse of the mean square is ν/(ν − 2) times 1/τ² on average: three features may happen to be close together.
    """
    m = max(len(points), 2)
    values = 3 * (m - 1)
    return rms_radius(points) * float(np.sqrt(m / (m - 1) * values / (values - 2)))


@dataclass(frozen=True, eq=False)
class OffsetRegularisation:
    """What the offsets of k bodies are held by.

    prior (k,): its information on each coordinate, 1/m²; firm (k, 3, 3): what has the prior's effect beside spurious
    information, 1/m² for errors that are new in every frame; None before that is found. times: how often it was.
    """

    prior: FloatArray
    firm: FloatArray | None = None
    times: int = 0

    @classmethod
    def of(cls, bodies: Sequence[Body]) -> "OffsetRegularisation":
        """The prior of bodies."""
        return cls(a_priori_information(bodies))

    def of_prior_alone(self) -> "OffsetRegularisation":
        """What holds the offsets by their prior, for good."""
        return replace(self, firm=None, times=MOST_TIMES)

    def prior_information(self, variance: float) -> FloatArray:
        """The prior's information (k, 3, 3) in the weights' units, for a variance of what all frames tell together."""
        return np.asarray(variance * self.prior[:, None, None] * np.eye(3))

    def information(self, frame_variance: float, lasting: float) -> FloatArray:
        """What holds the offsets, (k, 3, 3) in the weights' units.

        frame_variance: of an observation of weight 1; lasting: how many frames have the same errors.
        """
        return (
            self.prior_information(lasting * frame_variance)
            if self.firm is None
            else np.asarray(frame_variance * self.firm)
        )

    def firmer(
        self,
        frame_variance: float,
        lasting: float,
        covariance: FloatArray,
        held: FloatArray,
        spurious: Callable[[], Sequence[FloatArray]],
    ) -> "OffsetRegularisation | None":
        """What holds them firmly enough, where spurious information matters and that is not about what does; else None.

        covariance (3 k, 3 k) of the offsets that were held by information held (k, 3, 3), and spurious information
        (3, 3) on each body's, in the weights' units.
        """
        known = lasting * frame_variance * self.prior
        if self.times == MOST_TIMES or (np.repeat(known, 3) * np.diag(covariance)).max() <= NOTICEABLE:
            return None
        firm = against_spurious(known, covariance, held, spurious()) / frame_variance
        if self.firm is not None and np.abs(firm - self.firm).max() <= TOLERANCE * np.abs(self.firm).max():
            return None
        return replace(self, firm=firm, times=self.times + 1)


@dataclass(frozen=True, eq=False)
class PriorOnlySolution:
    """A solution with offsets that are held by their prior alone: bodies, x (p,), and the weighted squares there.

    spurious (k, 3, 3): the spurious information on the bodies' offsets.
    """

    bodies: tuple[Body, ...]
    x: FloatArray
    cost: float
    spurious: FloatArray

    @classmethod
    def of(
        cls, bodies: tuple[Body, ...], x: FloatArray, cost: float, spurious: Callable[[], Sequence[FloatArray]]
    ) -> "PriorOnlySolution":
        """The solution with spurious information (3, 3) on each body's offset."""
        return cls(bodies, x, cost, np.array(spurious()))

    def is_told(
        self, bodies: Sequence[Body], cost: float, variance: float, spurious: Callable[[], Sequence[FloatArray]]
    ) -> bool:
        """Whether its offsets are told after all, as what holds them leads bodies to greater squares than noise does,
        and to noisier attitudes: these made what is told seem spurious.

        Of features nearly in a line, with the centre of mass beside it, attitudes are far noisier where it is on it.
        variance: of the squares, for weights of 1. The slope of their sum has the noise of the spurious information S:
        along a change d of the offsets, twice the root of variance times dᵀ S d.
        """
        pairs = zip(bodies, self.bodies, strict=True)
        change = np.array([held.points.mean(axis=0) - own.points.mean(axis=0) for held, own in pairs])
        noise = 2 * float(np.sqrt(variance * np.einsum("ki,kij,kj->", change, self.spurious, change)))
        more = CONTRADICTED * variance + DEVIATIONS * noise
        return cost > self.cost + more and _trace(np.array(spurious())) > NOISIER * _trace(self.spurious)


def _trace(information: FloatArray) -> float:
    return float(np.trace(information, axis1=1, axis2=2).sum())


def against_spurious(
    known: FloatArray, covariance: FloatArray, held: FloatArray, spurious: Sequence[FloatArray]
) -> FloatArray:
    """The information (k, 3, 3) that has the prior's effect beside spurious information.

    Of the information I on an offset, the spurious S does not draw it anywhere, so that I − S against the prior P would
    draw it as far as noise of the information I leads. Against the precision (I − S) I⁻¹ (I − S) of what the tracks
    tell, P has its right weight: it is that of I (I − S)⁻¹ P against I − S. Where not even P is left of I − S, that is
    I, which holds the offset at the features.

    known (k,): information of the prior; covariance (3 k, 3 k): of the offsets, where they were held by the information
    held (k, 3, 3), so that its inverse is I besides; spurious (3, 3) of each body.
    """
    each = np.arange(len(known))
    offset = covariance.reshape(len(known), 3, len(known), 3)[each, :, each]
    own = np.linalg.pinv(offset, rcond=RANK, hermitian=True) - held
    values, axes = np.linalg.eigh((own + np.swapaxes(own, 1, 2)) / 2)
    values = np.maximum(values, LEAST * known[:, None])
    root = axes / np.sqrt(values)[:, None]
    share, along = np.linalg.eigh(np.swapaxes(root, 1, 2) @ np.array(spurious) @ root)
    columns, dual = root @ along, axes * np.sqrt(values)[:, None] @ along
    prior = known[:, None] * np.sum(columns**2, axis=1)
    left = np.clip(1 - share, np.minimum(prior, 1.0), 1.0)
    more = (dual * (prior * (1 / left - 1))[:, None]) @ np.swapaxes(dual, 1, 2)
    return np.asarray(known[:, None, None] * np.eye(3) + more)

"""Spurious information: apparent information from the noise of estimated attitudes, removed from a covariance."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.special import ndtr

from baryscope.estimator.adjustment.attitude_noise import Departures
from baryscope.estimator.adjustment.frame_shifts import FrameShifts, shifts_in
from baryscope.estimator.adjustment.normal_equations import attitude_covariances, normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.geometry.so3 import cross_matrices, turned_information
from baryscope.estimator.geometry.symmetric import inverted_sums
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

FARTHEST_RADII = 3.0  # standard deviation of an unobserved centre of mass from the features' centroid, in their radii
FRAMES = 3000  # frames of a body from which its spurious information is computed, approximately
IMPLAUSIBLE_RADII = 30.0  # of the features from their centroid: a centre of mass beyond is where errors have led it
DOUBTFUL = 0.2  # share of the information on an offset that is spurious: noise of five times the variance feigns all
UNKNOWN = 0.3  # rad, standard deviation of an attitude about an axis, from which it is not known
MARGIN = 3.0  # standard deviations of the spurious information above its mean: likely there is no more
NODES, CHANCES = (-np.sqrt(3.0), 0.0, np.sqrt(3.0)), (1 / 6, 2 / 3, 1 / 6)  # of a Gaussian variable, to fifth order
SPINNING = 0.2  # of objects, as targets that are stabilised by their spin: of these tracks tell nothing along an axis
RANK = 1e-14  # of a covariance's greatest value: less is a direction that is fixed


@dataclass(frozen=True, eq=False)
class SpuriousInformation:
    """Spurious information on q unknowns: its mean (q, q), and its standard deviation along any direction (q, q)."""

    mean: FloatArray
    deviation: FloatArray

    @classmethod
    def of(cls, mean: FloatArray, values: float) -> "SpuriousInformation":
        """That of so many Gaussian values: a mean of their squares scatters by √(2 / values) of itself."""
        return cls(mean, float(np.sqrt(2 / values)) * mean)

    @classmethod
    def of_each(cls, parts: Iterable["SpuriousInformation"]) -> "SpuriousInformation":
        """Spurious information on the unknowns of all parts, one after the other, each with information of its own."""
        means, deviations = zip(*((part.mean, part.deviation) for part in parts), strict=True)
        return cls(np.asarray(block_diag(*means)), np.asarray(block_diag(*deviations)))

    @property
    def likely(self) -> FloatArray:
        """A bound (q, q) of it that is likely to hold, with a margin of three standard deviations."""
        return self.mean + MARGIN * self.deviation

    def __add__(self, other: "SpuriousInformation") -> "SpuriousInformation":
        """The sum of both, as if they scattered together."""
        return SpuriousInformation(self.mean + other.mean, self.deviation + other.deviation)

    def scaled(self, factor: float) -> "SpuriousInformation":
        """Spurious information times a factor."""
        return SpuriousInformation(factor * self.mean, factor * self.deviation)


def effective_count(terms: FloatArray) -> float:
    """How many of the terms t (n,) of a sum give most of it: (Σ t)² / Σ t² (Kish 1965, Survey Sampling)."""
    return float(terms.sum()) ** 2 / max(float(terms @ terms), np.finfo(float).tiny)


def farthest(points: FloatArray, radii: float = FARTHEST_RADII) -> float:
    """The standard deviation, m, of the centre of mass in a direction that is not observed, for points (m, 3) from it.

    That is so many radii of the points about their centroid, or the distance to which spurious information has led.
    """
    distance, radius = _distance_and_radius(points)
    return max(radii * radius, distance, 1e-150)


def _distance_and_radius(points: FloatArray) -> tuple[float, float]:
    """The distance of the centroid of points (m, 3) from their origin, and their rms distance from it."""
    return float(np.linalg.norm(points.mean(axis=0))), rms_radius(points)


def implausible_columns(
    bodies: list[FloatArray], offset: FloatArray, crossed: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Columns as of `spurious_information_columns` that make an implausible offset as uncertain as it is long.

    In all directions, as a small error of its own turns it by metres.
    bodies: the points (m, 3) of each, m from the centre of mass; offset (3 k, 3 k) and crossed (3 k, p): covariances.
    """
    lengths, radii = np.transpose([_distance_and_radius(points) for points in bodies])
    far = lengths > IMPLAUSIBLE_RADII * radii
    return _with_others(np.diag(np.repeat(lengths, 3))[:, np.repeat(far, 3)], offset, crossed)


@dataclass(frozen=True, eq=False)
class OffsetPrior:
    """A prior on k offsets: its information (3 k, 3 k), and held (3 k, 3 k), what the estimate was held by for it."""

    information: FloatArray
    held: FloatArray


def offset_lengths(columns: FloatArray) -> FloatArray:
    """How far columns (3 k, d) displace the offset that they displace most, (d,) in m."""
    return np.asarray(np.sqrt((columns.reshape(-1, 3, columns.shape[1]) ** 2).sum(axis=1).max(axis=0)))


def spurious_information_columns(
    offset: FloatArray,
    crossed: FloatArray,
    spurious: SpuriousInformation,
    least: float,
    prior: OffsetPrior | None = None,
    lengths: Callable[[FloatArray], FloatArray] = offset_lengths,
) -> tuple[FloatArray, FloatArray]:
    """The increase of a joint covariance by spurious information.

    The noise of the attitudes does not make the cost steeper, on average, so that the information I of Gauss and Newton
    is too large by the spurious S; and it adds S to the variance of the cost's gradient. The variance is that of an
    estimating equation, (I − S)⁻¹ I (I − S)⁻¹. With a prior P, and held by P', it is the mean over S as it may be of
    (P'²/P + I)/(I − S + P')², I of the tracks alone. It is in no direction greater than that of the least information.

    offset (3 k, 3 k): covariance of k offsets; crossed (3 k, p): their covariance with the other unknowns; spurious:
    the information on the offsets to subtract; least: the least information on an offset in a direction; prior: that
    of the offsets, with which they have this covariance; lengths: columns (3 k, d) → how far
    they displace the centre of mass, m, if the unknowns are others than offsets.
    Returns columns A of the offsets (3 k, d) and B of the other unknowns (p, d): the covariances grow by A Aᵀ and B Bᵀ,
    the cross-covariance by A Bᵀ.
    """
    found = _Directions.of(offset, spurious, least, prior, lengths)
    return _with_others(found.columns * np.sqrt(np.maximum(found.remaining**-2.0 - 1, 0.0)), offset, crossed)


def untold_decrease(
    change: FloatArray,
    offset: FloatArray,
    spurious: SpuriousInformation,
    least: float,
    prior: OffsetPrior | None = None,
) -> float:
    """The predicted decrease of the cost by a change (3 k,) of the offsets where nothing but spurious information asks
    for it, less the square of what the change is to the covariance there.

    Steps in such a direction lead ever further, but not out of the standard deviation of the least information.
    offset, spurious, least and prior as of `spurious_information_columns`.
    """
    found = _Directions.of(offset, spurious, least, prior)
    deviations = np.linalg.lstsq(found.columns, change, rcond=None)[0]
    return float(np.sum(np.where(found.untold, deviations**2 * (1 - found.remaining**2), 0.0)))


def feigned_columns(
    bodies: list[FloatArray], offset: FloatArray, crossed: FloatArray, spurious: SpuriousInformation
) -> tuple[FloatArray, FloatArray]:
    """Columns as of `spurious_information_columns` that make offsets as uncertain as they are far, where feigned.

    That is along directions of which a share DOUBTFUL or more of the information is spurious, if that has led farther
    from the features than an offset that is not observed is expected to be. Noise that all features of a frame share,
    which no model has, leads there: it passes for a turn about a centre of mass far away, the longer the lever, the
    smaller the turn.
    bodies: the points (m, 3) of each, m from the centre of mass; offset, crossed and spurious as there.
    """
    found = _Directions.of(offset, spurious, 0.0, None)
    offsets = np.concatenate([points.mean(axis=0) for points in bodies])
    along = np.linalg.lstsq(found.columns, offsets, rcond=None)[0]
    led = found.columns @ np.where(found.share >= DOUBTFUL, along, 0.0)
    radii = np.array([_distance_and_radius(points)[1] for points in bodies])
    far = (np.linalg.norm(led.reshape(-1, 3), axis=1) > FARTHEST_RADII * radii).any()
    return _with_others(led[:, None] if far else np.zeros((len(led), 0)), offset, crossed)


def attenuated_columns(
    offsets: FloatArray, offset: FloatArray, crossed: FloatArray, spurious: SpuriousInformation, least: float
) -> tuple[FloatArray, FloatArray]:
    """Columns as of `spurious_information_columns` of what offsets (3 k,) lack that are found with attitudes as given.

    The noise of these does make the cost steeper, by S, with no slope for it: so the offsets are too near the features
    by (I − S)⁻¹ S of themselves, as a regression on a noisy variable is too flat (Fuller 1987, Measurement Error
    Models).
    """
    found = _Directions.of(offset, SpuriousInformation(spurious.mean, np.zeros_like(spurious.mean)), least, None)
    along = np.linalg.lstsq(found.columns, offsets, rcond=None)[0]
    lacking = found.columns @ (np.clip(found.share, 0.0, 1.0) / found.remaining * along)
    return _with_others(lacking[:, None], offset, crossed)


@dataclass(frozen=True, eq=False)
class _Directions:
    """Directions of offsets, columns (3 k, d) of one standard deviation each; spurious information is diagonal in them.

    share (d,): of the information, that is spurious; remaining (d,): the inverse of the factor on the deviation that is
    left without it; untold (d,): where that is the deviation of the least information, or of the prior.
    """

    columns: FloatArray
    share: FloatArray
    remaining: FloatArray
    untold: BoolArray

    @classmethod
    def of(
        cls,
        offset: FloatArray,
        spurious: SpuriousInformation,
        least: float,
        prior: OffsetPrior | None,
        lengths: Callable[[FloatArray], FloatArray] = offset_lengths,
    ) -> "_Directions":
        values, axes = np.linalg.eigh((offset + offset.T) / 2)
        seen = values > RANK * values[-1]
        root = axes[:, seen] * np.sqrt(values[seen])
        share, along = np.linalg.eigh(root.T @ spurious.likely @ root)
        columns = root @ along
        bounded = np.minimum(lengths(columns) * np.sqrt(least), 1.0)
        if prior is None:
            return cls(columns, share, np.maximum(1 - share, bounded), 1 - share < bounded)
        known, held, deviation = (
            np.einsum("ad,ab,bd->d", columns, own, columns, optimize=True)
            for own in (prior.information, prior.held, spurious.deviation)
        )
        least_told = np.maximum(1 - share - held, 0.0)  # of I = 1, by the tracks
        told = 1 - held - share + MARGIN * deviation
        variance = np.zeros_like(known)
        for value, chance in _values(told, deviation):
            own = (held**2 / known + 1 - held) / np.maximum(value + held, RANK) ** 2
            variance += chance * np.minimum(own, bounded**-2.0)
        return cls(columns, share, np.clip(variance**-0.5, bounded, 1.0), least_told < np.sqrt(known))


def _values(told: FloatArray, deviation: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """What tracks may tell (d,), and how probable that is, where their information less the spurious is `told`.

    That is nothing of an object that spins, else anything up to all of the information, 1, each as likely beforehand.
    """
    deviation = np.maximum(deviation, RANK)
    deviations = np.maximum(told / deviation, -MARGIN)  # less is no less likely a spin
    spins = SPINNING * np.exp(-(deviations**2) / 2) / (np.sqrt(2 * np.pi) * deviation)
    spins = spins / (spins + (1 - SPINNING) * ndtr(deviations))
    yield np.zeros_like(told), spins
    for node, chance in zip(NODES, CHANCES, strict=True):
        yield np.maximum(told + node * deviation, 0.0), (1 - spins) * chance


def _with_others(columns: FloatArray, offset: FloatArray, crossed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Columns (3 k, d) of the offsets, and what the other unknowns (p, d) do with them, by their joint covariance."""
    return columns, crossed.T @ np.linalg.pinv(offset, hermitian=True) @ columns


@dataclass(frozen=True, eq=False)
class NoisyAttitudes:
    """What noise does to the attitudes of a body's frames, of which each of `every` is taken.

    frames (n,): those taken, and attitude (n, 3, 3) there; known (n, 3, 3): the information Q on the frame's position
    in S, with the attitude unknown; covariance (n, 3, 3): C of the attitude, rad², and greatest (n,): its greatest
    variance.
    """

    every: int
    frames: IntArray
    attitude: FloatArray
    known: FloatArray
    covariance: FloatArray
    greatest: FloatArray

    @classmethod
    def of(
        cls,
        body: Body,
        observations: Observations,
        origin: FloatArray,
        variance: float,
        shifts: FrameShifts | None = None,
    ) -> "NoisyAttitudes":
        """The attitudes of a body.

        origin (n, 3): the path in C, m; variance: of an observation of weight 1; shifts: of the n frames.
        """
        every = max(1, len(body.frames) // FRAMES)
        frames, attitude = body.frames[::every], body.attitude[::every]
        found = normal_blocks(
            observations.frames(frames).features(body.features), attitude, origin[frames], body.points
        )
        (known, _), of_turn = found.shift_alone(), found.turn
        own = shifts_in(shifts, frames)
        if own is not None:
            known, of_turn = inverted_sums(known, own.among_all(attitude)), found.turn_alone(own.in_body(attitude))
        covariance = attitude_covariances(of_turn, variance)
        greatest = np.asarray(np.linalg.eigvalsh(covariance)[:, -1], dtype=np.float64)
        return cls(every, frames, attitude, known, covariance, greatest)

    def spurious_information(self) -> SpuriousInformation:
        """The spurious information (3, 3) in S on the body's offset, in the weights' units.

        An attitude error φ changes the offset d in C by φ × d, so that the expected information is
        Σ tr([eᵢ]×ᵀ Q [eⱼ]× C). The next order of φ adds a share of about the greatest variance of φ, in rad². It
        scatters as that of as many frames as give most of it, which may be few: those of which little is seen.
        """
        turned = (1 + self.greatest[:, None, None]) * self.covariance
        frames = self.every * effective_count(_terms(self.known, turned))
        return SpuriousInformation.of(self.every * turned_information(self.known, turned), max(frames, 1.0))

    def shown_information(self, departures: Departures) -> SpuriousInformation:
        """The spurious information as the attitudes' departures from their rotation show it, at least that expected.

        C is that of the attitudes as they are estimated: of a face seen at a right angle, the places across the line
        of sight tell no tilt, but seem to if noise has tilted the attitude, so that the frames which are off by most
        claim to be off by little. The departures need no C. Along axes in which both are diagonal, the information is
        greater by as much as Σ tr([eᵢ]×ᵀ Q [eⱼ]× φ φᵀ) is than its expectation, in frames whose fit is at least as sure
        as the attitude. As these are the errors that are there, a single one that gives most of it makes it no less
        certain.

        departures: of all frames of the body.
        """
        expected = self.spurious_information()
        surer = departures.surer[:: self.every]
        known, turn = self.known[surer], departures.turn[:: self.every][surer]
        values, axes = np.linalg.eigh(turned_information(known, departures.expected[:: self.every][surer]))
        if not values[0] > RANK * values[-1]:
            return expected
        squares, root = turn[:, :, None] * turn[:, None, :], axes / np.sqrt(values)
        ratio, along = np.linalg.eigh(root.T @ turned_information(known, squares) @ root)
        greater = (axes * np.sqrt(values)) @ along * np.sqrt(np.maximum(ratio, 1.0)) @ along.T @ root.T
        return SpuriousInformation(greater @ expected.mean @ greater.T, greater @ expected.deviation @ greater.T)

    def of_known(self) -> "NoisyAttitudes":
        """The attitudes of the frames that know theirs: of others, as where features are outliers, C says nothing."""
        kept = self.greatest < UNKNOWN**2
        return NoisyAttitudes(
            self.every,
            self.frames[kept],
            self.attitude[kept],
            self.known[kept],
            self.covariance[kept],
            self.greatest[kept],
        )

    def product_gradient(self, path: SampledPath, offset: FloatArray) -> FloatArray:
        """The variance (3 + p, 3 + p) of the cost's gradient by offset and x from products of errors, in squared
        weights, for a covariance (3, 3) of the offset in S, m².

        Where the offset is off by δ, an attitude error φ moves a frame by φ × δ, which is of second order and no
        residual of the solution shows. With P the covariance of δ, it is Σ Aᵀ Q Γ Q A, Γ = Σ Pᵢⱼ [eᵢ]× C [eⱼ]×ᵀ, A the
        Jacobian of the frame's position in S by offset and x.
        """
        axes = cross_matrices(np.eye(3))
        moved = np.einsum("ij,iab,kbc,jdc->kad", offset, axes, self.covariance, axes, optimize=True)
        weight = self.known @ moved @ self.known
        turned = self.attitude @ weight
        by_x = path.gram(self.frames, turned @ np.swapaxes(self.attitude, 1, 2))
        crossed = path.moment(self.frames, turned)
        return np.asarray(self.every * np.block([[weight.sum(axis=0), crossed.T], [crossed, by_x]]))


def _terms(known: FloatArray, turned: FloatArray) -> FloatArray:
    """The traces (n,) of the terms of `turned_information`, for information Q and a mean of φ φᵀ (n, 3, 3)."""
    traces = np.trace(known, axis1=1, axis2=2) * np.trace(turned, axis1=1, axis2=2)
    return np.asarray(traces - np.einsum("kij,kij->k", known, turned))

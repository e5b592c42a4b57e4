"""Noise of the position from frame to frame, as of a pivot that slips: its variance of maximum likelihood.

A frame's shift, with its rotation unknown, has the information N from its observations. Along the axes of N, with λ an
eigenvalue and z² the squared shift times λ, −2 ln of the likelihood of a variance s² is Σ ln(1 + λ s²) + z²/(1 + λ s²).

Slips may last. What is constant then knows as little as from white noise of s² times 1 + 2 Σ ρ, ρ the autocorrelations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.autocorrelation import growth_by_lasting
from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.normal_equations import normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.hyperparameters.scan import scanned_minimum
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

RANGE = (1e-4, 1e8)  # of the variance, over that with which the frames' median shift is known
SCAN, SWEEPS = 41, 4  # values of its logarithm, and how often the range is narrowed to two of its steps
SIGNIFICANT = 9.0  # 2 ln of the likelihood ratio to no noise, below which there is none
STILL = 2.7  # the same, where there was one: it does not come and go with what the solution allows for
CLEAR = 1.0  # standard deviations, from which slips last: to take those that do for white costs far more than to err
LONGER, FEWEST_SPANS = 4, 8  # factor from spans to longer ones; how many spans there are, at least
UNKNOWNS = 2  # of a coordinate: the place at rest, and the offset that turns with the body
MOST_EXPLAINED = 0.8  # share of the slips' variance
SLIP_TOLERANCE = 0.1  # relative change of the variance of a slipping position
MOST_SHAKE = 3e-3  # rad, of a camera from frame to frame: a sixth of a degree
BLOCKS, BLOCK = 5, 1200  # of successive frames of a body that are looked at where slow slips are none of it, at most
LIKELY = 2.7055  # χ² of one degree of freedom that 90 % are below
HALVINGS = 24  # of the range, to find where the likelihood has fallen by as much


@dataclass(frozen=True, eq=False)
class _Shifts:
    """Of the n spans of a body, along the axes of their information: shift (n, 3), m, and the variances (n, 3) to which
    it is known, m², infinite where it is not; axes (n, 3, 3), columns in C.
    """

    shift: FloatArray
    variance: FloatArray
    axes: FloatArray

    @classmethod
    def of(cls, information: FloatArray, rhs: FloatArray, variance: float) -> "_Shifts":
        """The shifts of spans of information (n, 3, 3) and right-hand sides (n, 3) in C, for a variance of weight 1."""
        along, axes = np.linalg.eigh(information)
        known = along > 1e-9 * along[:, -1:]
        moved = (np.swapaxes(axes, 1, 2) @ rhs[:, :, None])[:, :, 0]
        shift = np.divide(moved, along, out=np.zeros_like(along), where=known)
        return cls(shift, np.divide(variance, along, out=np.full_like(along, np.inf), where=known), axes)


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """Of the variance of n shifts: size (n,), 1/m², one over that to which each is known; square (n,): z²."""

    size: FloatArray
    square: FloatArray

    @classmethod
    def of(cls, series: Sequence[_Shifts]) -> "_Likelihood":
        """From the shifts of each body's spans, along the axes along which they are known."""
        known = [np.isfinite(one.variance) for one in series]
        size = np.concatenate([1 / one.variance[told] for one, told in zip(series, known, strict=True)])
        squares = [one.shift[told] ** 2 for one, told in zip(series, known, strict=True)]
        return cls(size, np.concatenate(squares) * size)

    def cost(self, logarithm: FloatArray) -> FloatArray:
        """−2 ln of the likelihood of variances exp(logarithm) (k,), (k,)."""
        grown = 1 + np.exp(logarithm)[:, None] * self.size
        return np.asarray((np.log(grown) + self.square / grown).sum(axis=1))

    @cached_property
    def range(self) -> FloatArray:
        """The least and the greatest logarithm that are tried (2,)."""
        return np.asarray(np.log(np.array(RANGE) / np.median(self.size)))

    @cached_property
    def best(self) -> tuple[float, float]:
        """The logarithm of the likeliest variance, and the cost there."""
        return scanned_minimum(self.cost, float(self.range[0]), float(self.range[1]), SCAN, SWEEPS)

    @property
    def gained(self) -> float:
        """2 ln of the likelihood over that of none."""
        return float(self.square.sum()) - self.best[1]

    @property
    def interval(self) -> tuple[float, float]:
        """The variances between which the likelihood is within that of 90 % of the best, m²; the least may be 0."""
        best, least = self.best
        within, beyond = np.array([best, best]), self.range.copy()
        for _ in range(HALVINGS):
            middle = (within + beyond) / 2
            likely = self.cost(middle) <= least + LIKELY
            within, beyond = np.where(likely, middle, within), np.where(likely, beyond, middle)
        low, high = np.exp(within).tolist()
        return (low if self.gained > LIKELY else 0.0), high


@dataclass(frozen=True, eq=False)
class Slip:
    """How far a position slips: variance of a coordinate as of white noise, m², zero unless it is significant.

    Where it is estimated, likelihood: that of the variance of the spans that show it best; factor: from that to
    `variance`.
    """

    variance: float = 0.0
    likelihood: _Likelihood | None = field(default=None, repr=False)
    factor: float = 1.0

    @property
    def deviation(self) -> float:
        """In m."""
        return float(np.sqrt(self.variance))

    @property
    def significance(self) -> float | None:
        """2 ln of the likelihood over that without, if it is estimated."""
        return None if self.likelihood is None else max(self.likelihood.gained, 0.0)

    @property
    def interval(self) -> tuple[float, float] | None:
        """The variances that hold 90 %, m², if it is estimated."""
        if self.likelihood is None:
            return None
        low, high = self.likelihood.interval
        return self.factor * low, self.factor * high


def position_slip(
    bodies: Sequence[Body],
    observations: Observations,
    origin: FloatArray,
    variance: float,
    lasting: float = 1.0,
    significant: float = SIGNIFICANT,
    *,
    slow: bool = True,
) -> Slip:
    """The slip of a position, of variance s² (1 + 2 Σ ρ).

    Slow slips hide in the noise of single frames. So spans of more and more frames are looked at, too, each as one, and
    those count that show a slip best.

    origin (n, 3) in C, m: the path; variance: of an observation of weight 1; lasting: in how many frames it is the
    same; significant: 2 ln of the likelihood ratio to no noise, below which there is none; slow: whether slips may be
    slow. Of a path with process noise they are the path's: the frames by themselves tell, of which some thousands do.
    """
    frames = [_of_frames(body if slow else _some_of(body), observations, origin) for body in bodies]
    longest, span, found = max(len(rhs) for _, rhs in frames) if slow else 1, 1, Slip()
    while span == 1 or FEWEST_SPANS * span <= longest:
        # Of many frames together the errors that last are as great as κ tells, of a single one they are in its noise.
        own = variance if span == 1 else lasting * variance
        series = [_Shifts.of(*_summed(information, rhs, span), own) for information, rhs in frames]
        likelihood = _Likelihood.of(series)
        if likelihood.gained > significant:
            slip, significant = float(np.exp(likelihood.best[0])), likelihood.gained
            factor = span * _frames_of_a_slip(series, slip)
            found = Slip(slip * factor, likelihood, factor)
        elif span == 1:
            found = Slip(0.0, likelihood)
        span *= LONGER
    return found


def _some_of(body: Body) -> Body:
    """A body in evenly spaced blocks of successive frames, so that what hangs together does."""
    n = len(body.frames)
    if n <= BLOCKS * BLOCK:
        return body
    kept = np.zeros(n, dtype=bool)
    begins = np.linspace(0, n - BLOCK, BLOCKS).astype(np.intp)
    kept[np.add.outer(begins, np.arange(BLOCK))] = True
    return body.in_frames(kept)


def _of_frames(body: Body, observations: Observations, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The information (n, 3, 3) on each frame's shift, its rotation unknown, and the right-hand side (n, 3), in C."""
    own = observations.frames(body.frames).features(body.features)
    information, rhs = normal_blocks(own, body.attitude, origin[body.frames], body.points).shift_alone()
    information = body.attitude @ information @ np.swapaxes(body.attitude, 1, 2)
    return information, (body.attitude @ rhs[:, :, None])[:, :, 0]


def _summed(information: FloatArray, rhs: FloatArray, span: int) -> tuple[FloatArray, FloatArray]:
    """Information and right-hand sides of spans of so many frames."""
    if span == 1:
        return information, rhs
    begins = np.arange(0, len(rhs), span)
    return np.add.reduceat(information, begins), np.add.reduceat(rhs, begins)


def _frames_of_a_slip(series: Sequence[_Shifts], slip: float) -> float:
    """1 + 2 Σ ρ, at least 1, of shifts that are known to their variances; slip: their own, m².

    Where a frame tells its shift poorly, as across the lever to a far tip, which its attitude moves, it counts little.
    What the frames are wrong by is white: only the slips' part of the squares hangs together. Place and offset follow
    slips that last, and leave less of their variance to see: of n frames, two of the n / (1 + 2 Σ ρ) that are new.
    """
    weights = [slip / (slip + one.variance) for one in series]
    shifts = [
        (one.axes @ (weight * one.shift)[:, :, None])[:, :, 0] for one, weight in zip(series, weights, strict=True)
    ]
    values = sum(float((weight**2).sum()) for weight in weights)
    observed = sum(float(np.vdot(shift, shift)) for shift in shifts) / (values * slip)
    frames = values / 3
    growth = growth_by_lasting(shifts, values, frames, observed, CLEAR)
    return growth / (1 - min(UNKNOWNS * growth / frames, MOST_EXPLAINED)) if growth > 1 else growth


@dataclass(frozen=True, eq=False)
class LastingAndShared:
    """What is taken for given of errors that are not new in every observation, until the steps have converged.

    lasting: how many frames have the same errors of the features; slip: of the position; shifts: of the frames, None
    where there are none, for `told`, the variance of an observation of weight 1 in what all frames tell, m² or 1.
    """

    lasting: float
    slip: Slip = Slip()
    told: float = np.nan
    shifts: FrameShifts | None = None

    def at(self, errors: SharedErrors | None, origin: FloatArray, frame_variance: float) -> "LastingAndShared":
        """With the shifts at a path, origin (n, 3) in C, m, by noise of the camera's attitude and by slip.

        frame_variance: of an observation of weight 1 in a frame by itself.
        """
        shifts = FrameShifts.of(errors, origin, self.slip.variance, frame_variance, self.lasting)
        return replace(self, told=self.lasting * frame_variance, shifts=shifts)

    def slipping(
        self, bodies: Sequence[Body], observations: Observations, origin: FloatArray, variance: float, *, slow: bool
    ) -> "LastingAndShared":
        """With the slip that a path, origin (n, 3) in C, m, leaves.

        variance: of an observation of weight 1; slow: whether slips may be slow, see `position_variance`. Those that
        may not are of a camera that shakes. A path that is far off seems to show more than any camera shakes, and than
        the features are apart: that is no slip.
        """
        significant = STILL if self.slip.variance > 0 else SIGNIFICANT
        slip = position_slip(bodies, observations, origin, variance, self.lasting, significant, slow=slow)
        if slip.variance > self.slip.variance:
            most = max(rms_radius(body.points) for body in bodies)
            if not slow:
                distance = np.median(np.linalg.norm(observations.position[observations.weight > 0], axis=-1))
                most = min(most, MOST_SHAKE * distance)
            if slip.variance > most**2:
                return self
        return replace(self, slip=slip)

    def slips_unlike(self, other: "LastingAndShared") -> bool:
        """Whether the slip is clearly another."""
        own, others = self.slip.variance, other.slip.variance
        return abs(own - others) > SLIP_TOLERANCE * max(own, others)

"""What frames tell of a path beside burns: attitudes, and the origin of a body's axes, c_k − R_k d = g(t_k).

They are those of the registration, or those of a known motion, by which poor depths do no harm.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.attitude_noise import strays
from baryscope.estimator.adjustment.normal_equations import normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.subsample import SUBSAMPLE_FRAMES, Subsample, subsampled
from baryscope.estimator.geometry.symmetric import symmetric_inverses
from baryscope.estimator.pivot.drift import frame_covariances
from baryscope.estimator.pivot.free_attitudes import Solution
from baryscope.estimator.pivot.refinement import ROUNDING
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

LEAST_WEIGHT = 0.5  # of a frame's observations: all of those with less are rejected


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of f frames: rows (f,) of the tracks, attitude R_C_S (f, 3, 3) and origin (f, 3) of the axes S in C, m.

    axes (f,): the index of the axes, each of which has an offset; variance of an observation of weight 1, m², or 1 with
    covariances, and the least that it may be.
    """

    rows: IntArray
    attitude: FloatArray
    origin: FloatArray
    axes: IntArray
    variance: float
    least: float


class Posed(Protocol):
    """Where poses come from."""

    @property
    def poses(self) -> Poses:
        """The poses themselves."""
        ...

    @property
    def offsets(self) -> FloatArray:
        """The offsets (k, 3) of all axes in a solution without burns, m."""
        ...

    def covariances(self, offsets: FloatArray) -> FloatArray:
        """The covariances (f, 3, 3) of c − R d in S, for the offsets (k, 3) of all axes, over the variance."""
        ...

    def bodies(self, offsets: FloatArray) -> tuple[Body, ...]:
        """The bodies, with points from the centre of mass at offsets (k, 3)."""
        ...


@dataclass(frozen=True, eq=False)
class RegisteredPoses:
    """Poses of the registered bodies, whose attitudes have errors that the lever of an offset shows.

    few: the bodies in frames of which all rows count; the others as in `Posed`.
    """

    registered: Registered
    few: Subsample
    poses: Poses
    offsets: FloatArray

    @classmethod
    def of(
        cls, registered: Registered, observations: Observations, time: FloatArray, found: Solution
    ) -> "RegisteredPoses":
        """The poses of a subsample of the bodies, less attitudes that stray from the rotation.

        time (n,) of all frames in s; found: a solution without burns, whose offsets weigh the frames. Three features of
        which a rig hardly knows the depth have several poses that fit as well, and one at which the body never was
        needs a burn to and fro, whatever its weight.
        """
        few = subsampled(registered.bodies, observations, SUBSAMPLE_FRAMES)
        distance = max(float(np.abs(origin).max()) for origin in registered.origins)
        least = (ROUNDING * distance) ** 2
        variance = max(registered.noise**2, least) if few.observations.precision is None else 1.0
        kept = [~stray | stray.all() for stray in strays(few.bodies, few.observations, time[few.rows], variance)]
        bodies = tuple(body.in_frames(own) for body, own in zip(few.bodies, kept, strict=True))
        origins = zip(registered.origins, few.steps, kept, strict=True)
        origin = np.concatenate([one[::step][own] for one, step, own in origins])
        both = zip(registered.bodies, found.bodies, strict=True)
        offsets = [after.points.mean(axis=0) - before.like(after).points.mean(axis=0) for before, after in both]
        poses = Poses(few.rows[_frames(bodies)], _attitudes(bodies), origin, _axes(bodies), variance, least)
        return cls(registered, replace(few, bodies=bodies), poses, np.array(offsets))

    def covariances(self, offsets: FloatArray) -> FloatArray:
        """See `Posed`."""
        return np.concatenate(frame_covariances(self.few.bodies, self.few.observations, tuple(offsets)))

    def bodies(self, offsets: FloatArray) -> tuple[Body, ...]:
        """See `Posed`."""
        pairs = zip(self.registered.bodies, offsets, strict=True)
        return tuple(replace(body, points=body.points + offset) for body, offset in pairs)


@dataclass(frozen=True, eq=False)
class KnownPoses:
    """Poses of bodies whose points and attitudes are known in axes that all have in common, but for where the centre of
    mass is.

    placed: the bodies; covariance (f, 3, 3) in the axes, over the variance; the others as in `Posed`.
    """

    placed: tuple[Body, ...]
    covariance: FloatArray
    poses: Poses
    offsets: FloatArray

    @classmethod
    def of(
        cls, bodies: tuple[Body, ...], observations: Observations, origin: FloatArray, variance: float
    ) -> "KnownPoses":
        """The poses of bodies of one set of axes, points from about the centre of mass.

        observations (n, m) with robust weights; origin (n, 3): near that of the axes in C, m; variance: of an
        observation of weight 1.
        """
        few = subsampled(bodies, observations, SUBSAMPLE_FRAMES)
        kept, places, covariances = [], [], []
        for body in few.bodies:
            weight = few.observations.weight[body.block]
            own = body.in_frames(weight.sum(axis=1) > LEAST_WEIGHT)
            seen, near = few.observations.frames(own.frames).features(own.features), origin[few.rows[own.frames]]
            blocks = normal_blocks(seen, own.attitude, near, own.points)
            inverse = symmetric_inverses(blocks.shift)
            shift = inverse @ blocks.shift_rhs[:, :, None]
            kept.append(own)
            places.append(near + (own.attitude @ shift)[:, :, 0])
            covariances.append(inverse)
        place = np.concatenate(places)
        least = (ROUNDING * float(np.abs(place).max())) ** 2
        together = np.zeros(len(place), dtype=np.intp)
        poses = Poses(few.rows[_frames(kept)], _attitudes(kept), place, together, max(variance, least), least)
        return cls(bodies, np.concatenate(covariances), poses, np.zeros((1, 3)))

    def covariances(self, offsets: FloatArray) -> FloatArray:
        """See `Posed`; known attitudes have no errors that an offset shows."""
        return self.covariance

    def bodies(self, offsets: FloatArray) -> tuple[Body, ...]:
        """See `Posed`."""
        return tuple(replace(body, points=body.points + offsets[0]) for body in self.placed)


def _frames(bodies: Iterable[Body]) -> IntArray:
    return np.concatenate([body.frames for body in bodies])


def _attitudes(bodies: Iterable[Body]) -> FloatArray:
    return np.concatenate([body.attitude for body in bodies])


def _axes(bodies: Iterable[Body]) -> IntArray:
    """The index of the body that each pose is of."""
    return np.concatenate([np.full(len(body.frames), index) for index, body in enumerate(bodies)])

"""`pivot` as a solution: what its covariance, its findings and the other methods need of it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.attitude_noise import departures_of
from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.position_noise import Slip
from baryscope.estimator.adjustment.spurious import NoisyAttitudes, SpuriousInformation
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.findings import Finding
from baryscope.estimator.geometry.symmetric import factor_of
from baryscope.estimator.hyperparameters.evidence import solved
from baryscope.estimator.hyperparameters.integration import Posterior
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.paths.seen_path import as_seen
from baryscope.estimator.pivot.free_attitudes import Linearised, Solution, linearised
from baryscope.estimator.pivot.lost_bodies import LOST
from baryscope.estimator.pivot.offset_prior import OffsetRegularisation
from baryscope.estimator.pivot.reduced import stepped
from baryscope.estimator.pivot.tie_points import TiePoints
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LOOKED_AT = 1e-4  # share of spurious information, as weights and residuals have it, from which the rotation shows it
DECISIVE = 2 * float(np.log(10.0))  # of −2 ln p, for one model: strong evidence (Jeffreys 1961, app. B)
SIGNIFICANT = 15.0  # 2 ln of a likelihood over that without an effect: by chance once in 20,000 cases


@dataclass(frozen=True, eq=False)
class LastStep:
    """The last step of a solution: the decrease of the cost that it predicted, what it changed the bodies' offsets by,
    (3 k,) m, and whether the weights had settled.
    """

    decrease: float
    offsets: FloatArray
    steady: bool


@dataclass(frozen=True, eq=False)
class PivotSolution:
    """The solution of `pivot`, from which `ml` starts.

    path, and sampled at the tracks' times, (n,) in s, as the camera sees it; inliers (n, m): which observations passed
    the screening; solution: bodies with points from the centre of mass, and the path's x; untied: where the iteration
    has ended, without tie points; observations (n, m) with their final weights; frame_variance of an observation of
    weight 1, as given or from the residuals: in m², or as a factor on the given covariances; residual_variance: that
    from the residuals; lasting: how many frames have the same errors of the features; posterior of x and of the
    hyperparameters of its prior; path_unknowns: the number of unknowns of x that the observations determine.
    regularisation: what the bodies' offsets are held by, and offset_information (k, 3, 3): how firmly in the last step,
    in the weights' units. stereo: whether the given covariances are those of a stereo rig at the measured points.
    slip: of the position. tie_points between bodies that share features, and those
    refused as the labels belong to different points, or bodies disagree; shifts: of the n frames; findings against the
    models.
    """

    path: Path
    sampled: SampledPath
    time: FloatArray
    inliers: BoolArray
    solution: Solution
    untied: Solution
    observations: Observations
    frame_variance: float
    residual_variance: float
    lasting: float
    posterior: Posterior
    path_unknowns: float
    converged: bool
    rounds: int
    regularisation: OffsetRegularisation
    offset_information: FloatArray
    stereo: bool
    slip: Slip
    tie_points: tuple[TiePoints, ...]
    refused: tuple[TiePoints, ...]
    last: LastStep
    shifts: FrameShifts | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def different(self) -> tuple[TiePoints, ...]:
        """The refused tie points of labels that belong to different points."""
        return tuple(tie for tie in self.refused if tie.disagreement is None)

    @property
    def variance(self) -> float:
        """The variance of an observation of weight 1 in what all frames tell together."""
        return self.lasting * self.frame_variance

    @property
    def noise(self) -> float:
        """The standard deviation of a coordinate of a feature, as the residuals have it, m."""
        seen, precision = self.observations.weight > 0, self.observations.precision
        size = 1.0 if precision is None else 3 / float(np.trace(precision[seen], axis1=1, axis2=2).mean())
        return float(np.sqrt(self.residual_variance * size))

    @property
    def offset_prior_information(self) -> FloatArray:
        """The information (k, 3, 3) of the prior of the bodies' offsets, in the weights' units."""
        return self.regularisation.prior_information(self.variance)

    @cached_property
    def problem(self) -> Linearised:
        """The least-squares problem linearised at the solution."""
        at = self.bodies, self.observations, self.sampled, self.solution.x
        return linearised(*at, self.shifts, self.offset_information)

    @cached_property
    def untied_problem(self) -> Linearised:
        """The least-squares problem linearised where the iteration has ended, without tie points."""
        if not self.tie_points:
            return self.problem
        at = self.untied.bodies, self.observations, self.sampled, self.untied.x
        return linearised(*at, self.shifts, self.offset_information)

    @cached_property
    def at_likeliest(self) -> Solution:
        """The solution with covariances for the likeliest hyperparameters: those that are unknown tell nothing
        spurious. With tie points, which tell more, it is the solution itself.
        """
        if self.tie_points:
            return self.solution
        return stepped(self.problem, self.path.prior, self.posterior.theta, self.variance)

    def position(self, time: FloatArray) -> FloatArray:
        """The path (k, 3) in C at times (k,) in s, m."""
        return self.path.at(time).position(self.solution.x)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies, with points in m from the centre of mass."""
        return self.solution.bodies

    @cached_property
    def noisy_attitudes(self) -> tuple[NoisyAttitudes, ...]:
        """What noise does to the attitudes of each body."""
        origin = self.sampled.position(self.solution.x)
        variance = max(self.frame_variance, self.residual_variance)  # of what is told, outliers may leave more
        return noisy_attitudes(self.bodies, self.observations, origin, variance, self.shifts)

    @cached_property
    def spurious(self) -> tuple[SpuriousInformation, ...]:
        """The spurious information on each body's offset, in the weights' units."""
        return tuple(noisy.spurious_information() for noisy in self.noisy_attitudes)

    @cached_property
    def spurious_share(self) -> float:
        """The spurious information over that on the bodies' offsets, in the direction where it is greatest."""
        return self._share_of(SpuriousInformation.of_each(self.spurious))

    @cached_property
    def shown_spurious(self) -> SpuriousInformation:
        """The spurious information on the bodies' offsets; where it matters, as the rotation shows it.

        Jointly for all bodies: spurious information of one body on the path would propagate to the others. One that is
        lost has none.
        """
        each = list(self.spurious)
        if self.spurious_share >= LOOKED_AT:
            at = self.observations, self.time, self.frame_variance, self.shifts
            departures = [departures_of(body, *at) for body in self.bodies]
            pairs = zip(self.noisy_attitudes, departures, strict=True)
            each = [noisy.shown_information(own) for noisy, own in pairs]
        pairs_of_lost = zip(each, self.lost, strict=True)
        return SpuriousInformation.of_each(own.scaled(float(not lost)) for own, lost in pairs_of_lost)

    @cached_property
    def shown_spurious_share(self) -> float:
        """The spurious information over that on the offsets, where it is greatest, as the rotation shows it.

        A few attitudes that are off by many deviations, as their frame's only features are displaced, may give most.
        """
        if self.spurious_share < LOOKED_AT:
            return self.spurious_share
        return self._share_of(self.shown_spurious)

    def _share_of(self, spurious: SpuriousInformation) -> float:
        """The share of what is likely spurious, in the direction where it is greatest."""
        return float(np.linalg.eigvals(self.solution.offset_covariance @ spurious.likely).real.max())

    def shown_spurious_shares(self, body: int, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The shares (r,), ascending, as the rotation shows them for the offset of a body, by index, along unit vectors
        (d, 3) in its axes; and measures (3, r) of a variance of 1 in the weights' units, whose shares these are.

        Other bodies may tell nothing of their offsets, and share the path; along other directions it may not be told.
        """
        own = slice(3 * body, 3 * body + 3)
        along = self.solution.offset_covariance[own, own] @ directions.T
        root = np.linalg.pinv(factor_of(directions @ along))
        shares, axes = np.linalg.eigh(root @ along.T @ self.shown_spurious.likely[own, own] @ along @ root.T)
        return shares, directions.T @ root.T @ axes

    def at_mean(self, errors: SharedErrors | None) -> "PivotSolution":
        """The solution at the mean over the hyperparameters, in place of that for the likeliest; errors: the camera's.

        It has the least expected error, but it is not where the iteration would end.
        """
        change = self.posterior.mean - self.posterior.likeliest
        if self.tie_points:  # which have told the path more since
            change = self.solution.covariance @ solved(self.posterior.covariance, self.variance * change[:, None])[:, 0]
        solution = self.solution.moved_to(self.solution.x + change)
        return replace(self, solution=solution, sampled=as_seen(self.path, self.sampled.itself, errors, solution.x))

    @cached_property
    def lost(self) -> BoolArray:
        """Of which bodies nearly all observations are rejected, (k,): they tell nothing."""
        own = [self.observations.weight[body.block] for body in self.bodies]
        return np.array([weight.sum() <= LOST * np.count_nonzero(weight) for weight in own])

    def has(self, name: str) -> bool:
        """Whether the path's prior has a hyperparameter of this name, and its effect is significant."""
        index = self.path.prior.index(name)
        return index is not None and bool(self.posterior.significance[index] >= SIGNIFICANT)


def noisy_attitudes(
    bodies: tuple[Body, ...],
    observations: Observations,
    origin: FloatArray,
    variance: float,
    shifts: FrameShifts | None,
) -> tuple[NoisyAttitudes, ...]:
    """What noise does to the attitudes of each body; arguments as of `NoisyAttitudes.of`."""
    return tuple(NoisyAttitudes.of(body, observations, origin, variance, shifts) for body in bodies)


def spurious_of_known(
    bodies: tuple[Body, ...],
    observations: Observations,
    origin: FloatArray,
    variance: float,
    shifts: FrameShifts | None,
) -> list[FloatArray]:
    """The spurious information (3, 3) on each body's offset by the frames whose attitudes are known."""
    noisy = noisy_attitudes(bodies, observations, origin, variance, shifts)
    return [one.of_known().spurious_information().likely for one in noisy]

"""The problem that the passes of `ekf` solve: observations, models, and prior."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.spurious import FARTHEST_RADII
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.ekf.bank import GENEROUS, Axis, Member, level_of
from baryscope.estimator.ekf.filter import ProcessNoise
from baryscope.estimator.ekf.linearised import INERTIA, PATH, STATE, Reference
from baryscope.estimator.ekf.motion import (
    PathProcess,
    at_rest,
    free_motion,
    integrated_noise,
    logarithm_of_inertia,
    relative_motion,
    span_of,
)
from baryscope.estimator.ekf.solution import Prior
from baryscope.estimator.ekf.start import Start, unit_of
from baryscope.estimator.ml.model import FrameNoise
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.path import FIXED, Path
from baryscope.estimator.progress import Rounds
from baryscope.estimator.tracks import FeatureTracks, FloatArray, errors_of

FREE_TURN = 0.3  # rad from node to node, by noise that leaves the attitudes free
PRIOR_INERTIA_DEVIATION = 1.0  # of the inertia's logarithm from that of a sphere
FAR = 100.0  # standard deviation of a path's unknowns over the distance
ROUNDING = 1e-7  # of the distance: standard deviation of residuals that are rounding


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be solved.

    measured: observations; path without noise; on_orbit: whether it is a motion there, of six unknowns, and those of
    burns; theta (h,): the hyperparameters of its prior; rounds: told of each pass.
    """

    tracks: FeatureTracks
    options: PathOptions
    measured: Observations
    start: Start
    path: Path
    on_orbit: bool
    theta: FloatArray
    rounds: Rounds

    @property
    def slips(self) -> bool:
        """Whether the path's noise is one of the position of a fixed point, instead of its acceleration."""
        return self.path.name == FIXED

    @cached_property
    def errors(self) -> SharedErrors | None:
        """The errors of the tracks' camera at the frames."""
        return errors_of(self.tracks)

    def frame_noise(self, variance: float) -> FrameNoise | None:
        """The noise of whole frames, by the camera's attitude, relative to the variance of an observation."""
        return FrameNoise.of(self.errors, 0.0, len(self.tracks.time), variance)

    @property
    def span(self) -> float:
        """The time span in s."""
        return span_of(self.tracks.time)

    @property
    def given_variance(self) -> float | None:
        """The variance, where it is given, of an observation of weight 1, m² or a factor on the given covariances."""
        return None if self.options.sigma is None else self.options.sigma**2

    @cached_property
    def unit(self) -> float:
        """The variance of a coordinate, m², of a typical observation of weight 1."""
        return unit_of(self.tracks)

    @cached_property
    def floor(self) -> float:
        """The least variance of an observation of weight 1: below it residuals are rounding."""
        distance = float(np.abs(self.measured.position).max())
        return (ROUNDING * distance) ** 2 / self.unit

    @cached_property
    def noise_units(self) -> FloatArray:
        """The covariances (n - 1, 2, d, d) of each step between nodes for unit densities, see `ProcessNoise`."""
        return self.noise_units_at(self.start.nodes.time)

    def noise_units_at(self, time: FloatArray) -> FloatArray:
        """The covariances (n - 1, 2, d, d) of each step between times (n,) in s for unit densities."""
        units = np.zeros((len(time) - 1, 2, STATE, STATE))
        units[:, 0, PATH, PATH] = integrated_noise(time, self.span)
        units[:, 1, 6:, 6:] = integrated_noise(time)
        return units

    def process(self, shift: FloatArray, time: FloatArray | None = None) -> PathProcess:
        """The path's process about a nominal motion: at first in the features' centroid; on an orbit it is moved.

        shift (s,): of the unknowns x; time (n,) in s, the nodes' if None.
        """
        own = self.start.nodes.time
        time = own if time is None else time
        if self.on_orbit:
            x, first = at_rest(self.path, own, self.start.centroid, shift), int(np.searchsorted(time, own[0]))
            return relative_motion(self.path, time, x, self.span, first)
        return free_motion(self.path, time, self.start.centroid, self.span)

    def noise(self, members: Sequence[Member], variance: float) -> ProcessNoise:
        """The process noise of members, relative to the variance of an observation."""
        density = np.array([[member.path, member.turn] for member in members]) / variance
        shift = np.zeros(len(members))
        if self.slips:
            shift, density[:, 0] = density[:, 0].copy(), 0.0
        return ProcessNoise(self.noise_units, density, shift)

    def axes(self, variance: float) -> tuple[Axis, Axis]:
        """The hypotheses for path and rotation, for this variance of an observation."""
        metres, start = variance * self.unit, self.start
        return (
            Axis(metres if self.slips else level_of(metres, self.span), self.options.process_noise),
            Axis(level_of(metres / start.radius**2, self.span), self.options.torque_noise),
        )

    def first_torque(self, axis: Axis) -> float:
        """The density of the torque for the first pass: none if a free tumble explains the attitudes, else plenty."""
        return axis.given if self.start.explained or not axis.free else self.plenty_of_torque(axis)

    def plenty_of_torque(self, axis: Axis) -> float:
        """The density of a torque that leaves the attitudes free."""
        step = float(np.median(np.diff(self.start.nodes.time)))
        return max(axis.at(GENEROUS), 3 * FREE_TURN**2 / step**3)

    def prior(self, reference: Reference, shift: FloatArray, variance: float) -> Prior:
        """The prior about a reference; shift (s,): of its path's unknowns from those in the features' centroid.

        The centre of mass is near the centroid of the features in B. That tells of the path only what the body tells.
        """
        seen = np.asarray((self.start.weight > 0).any(axis=0))
        mean = np.where(seen, 1 / np.count_nonzero(seen), 0.0)
        of_points = np.diag(np.where(seen, 0.0, 1.0))
        of_points += variance * np.outer(mean, mean) / (FARTHEST_RADII * self.start.radius) ** 2
        information = block_diag(
            variance / PRIOR_INERTIA_DEVIATION**2 * np.eye(INERTIA),
            variance * np.diag(self._path_information),
            np.zeros((3, 3)),
            np.kron(of_points, np.eye(3)),
        )
        towards_centroid = np.where(seen[:, None], -(mean @ reference.points), 0.0)
        before = [-logarithm_of_inertia(reference.inertia), -shift, np.zeros(3), towards_centroid.ravel()]
        return Prior(np.concatenate(before), information)

    @cached_property
    def _path_information(self) -> FloatArray:
        """The information of the prior of the path's unknowns (s,), 1/m²: its own, or one without an effect."""
        prior, farthest = self.path.prior, FAR * float(np.abs(self.measured.position).max())
        return np.where(prior.free, farthest**-2.0, prior.precision(self.theta))

    def dof(self, observations: Observations) -> float:
        """Values less unknowns without a prior of their own."""
        seen = np.count_nonzero(observations.weight.max(axis=0, initial=0.0) > NEGLIGIBLE)
        unknowns = INERTIA + self.weakly_known + 3 + 3 * seen
        return max(3 * float(observations.weight.sum()) - unknowns, 1.0)

    @property
    def weakly_known(self) -> int:
        """The number of the path's unknowns that have a weak prior only."""
        return int(self.path.prior.free.sum())

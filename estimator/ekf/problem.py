"""The problem that the passes of `ekf` solve: observations, models, and prior."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.ekf.bank import GENEROUS, Axis, Member, path_level, turn_level
from baryscope.estimator.ekf.filter import ProcessNoise
from baryscope.estimator.ekf.linearised import INERTIA, Reference, points_from
from baryscope.estimator.ekf.motion import (
    PathProcess,
    at_rest,
    derivatives,
    logarithm_of_inertia,
    relative_motion,
    span_of,
    turning_noise,
    white_noise,
)
from baryscope.estimator.ekf.solution import Prior
from baryscope.estimator.ekf.start import Start, unit_of
from baryscope.estimator.options import PathOptions
from baryscope.estimator.progress import Rounds
from baryscope.estimator.tracks import FeatureTracks, FloatArray

FREE_TURN = 0.3  # rad from node to node, by noise that leaves the attitudes free
PRIOR_INERTIA_DEVIATION = 1.0  # of the inertia's logarithm from that of a sphere
PRIOR_EXTENTS = 3.0  # standard deviation of the centre of mass in radii of the features, and of the path in its extent
ROUNDING = 1e-7  # of the distance: standard deviation of residuals that are rounding


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be solved.

    measured: observations; order of the noisy derivative of the path; motion: the relative motion on an orbit, of six
    unknowns, None for a polynomial; rounds: told of each pass; thrusted: a polynomial with the response to a known
    acceleration, None without.
    """

    tracks: FeatureTracks
    options: PathOptions
    measured: Observations
    start: Start
    order: int
    motion: Path | None
    rounds: Rounds
    thrusted: Path | None = None

    @property
    def span(self) -> float:
        """The time span in s."""
        return span_of(self.tracks.time)

    @property
    def sigma(self) -> float | None:
        """The known variance of an observation of weight 1, m² or a factor on the given covariances."""
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
        """The same between times (n,) in s."""
        p = 3 * (self.order + 1)
        units = np.zeros((len(time) - 1, 2, p + 6, p + 6))
        units[:, 0, :p, :p] = white_noise(self.order, time, self.span)
        units[:, 1, p:, p:] = turning_noise(time)
        return units

    def process(self, shift: FloatArray, time: FloatArray | None = None) -> PathProcess:
        """The path's process about a nominal motion: at first in the features' centroid, then moved.

        shift (p,): of the state u at the first node; time (n,) in s, the nodes' if None.
        """
        own = self.start.nodes.time
        time = own if time is None else time
        if self.motion is not None:
            return relative_motion(self.motion, time, at_rest(self.motion, own, self.start.centroid, shift), self.span)
        found = derivatives(self.order + 1, time, self.start.centroid, self.span)
        if self.thrusted is None:
            return found
        return found.moved(self.thrusted.at(time).offset, self.thrusted.rate_at(time).offset)

    def noise(self, members: Sequence[Member], variance: float) -> ProcessNoise:
        """The process noise of members, relative to the variance of an observation."""
        density = np.array([[member.path, member.turn] for member in members]) / variance
        shift = np.zeros(len(members))
        if self.order == 0:
            shift, density[:, 0] = density[:, 0].copy(), 0.0
        return ProcessNoise(self.noise_units, density, shift)

    def axes(self, variance: float) -> tuple[Axis, Axis]:
        """The hypotheses for path and rotation, for this variance of an observation."""
        metres, start = variance * self.unit, self.start
        return (
            Axis(path_level(self.order, metres, self.span), self.options.process_noise),
            Axis(turn_level(metres, start.radius, self.span), self.options.torque_noise),
        )

    def first_torque(self, axis: Axis) -> float:
        """The density of the torque for the first pass: none if a free tumble explains the attitudes, else plenty."""
        return axis.given if self.start.explained or not axis.free else self.plenty_of_torque(axis)

    def plenty_of_torque(self, axis: Axis) -> float:
        """The density of a torque that leaves the attitudes free."""
        step = float(np.median(np.diff(self.start.nodes.time)))
        return max(axis.at(GENEROUS), 3 * FREE_TURN**2 / step**3)

    def prior(self, reference: Reference, shift: FloatArray, variance: float) -> Prior:
        """The prior about a reference; shift (p,): of its first state from the features' centroid."""
        p, m = 3 * (self.order + 1), self.start.weight.shape[1]
        size = points_from(p) - 1 + 3 * m
        mean, information = np.zeros(size), np.zeros(size)
        mean[:INERTIA] = -logarithm_of_inertia(reference.inertia)
        information[:INERTIA] = variance / PRIOR_INERTIA_DEVIATION**2
        extent = np.repeat([self.start.radius, *[max(self.start.extent, self.start.radius)] * self.order], 3)
        information[INERTIA : INERTIA + p] = variance * self.unit / (PRIOR_EXTENTS * extent) ** 2
        mean[INERTIA : INERTIA + p] = -shift
        unseen = ~(self.start.weight > 0).any(axis=0)
        information[points_from(p) - 1 :] = np.repeat(np.where(unseen, 1.0, 0.0), 3)
        return Prior(mean, information)

    def dof(self, observations: Observations) -> float:
        """Values less unknowns."""
        seen = np.count_nonzero(observations.weight.max(axis=0, initial=0.0) > NEGLIGIBLE)
        unknowns = points_from(3 * (self.order + 1)) - 1 + 3 * seen
        return max(3 * float(observations.weight.sum()) - unknowns, 1.0)

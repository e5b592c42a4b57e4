"""Iteration of the Gauss–Newton steps and the robust weights from an initial solution to convergence."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.degrees_of_freedom import degrees_of_freedom, least_variance
from baryscope.estimator.adjustment.lasting_errors import frames_per_error
from baryscope.estimator.adjustment.position_noise import LastingAndShared, Slip
from baryscope.estimator.adjustment.reweighting import WEIGHT_CHANGE_TOLERANCE, reweighted
from baryscope.estimator.adjustment.stereo import StereoNoise, stereo_noise
from baryscope.estimator.hyperparameters.evidence import held, improved
from baryscope.estimator.hyperparameters.integration import posterior
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.paths.process_noise import enriched
from baryscope.estimator.paths.seen_path import as_seen
from baryscope.estimator.pivot.few_features import with_few_features, with_found_attitudes
from baryscope.estimator.pivot.free_attitudes import MOST_HALVINGS, Linearised, StepStart, linearised
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.lost_bodies import brought_back_bodies, regained, without_scraps, without_untold_features
from baryscope.estimator.pivot.offset_prior import CONTRADICTED, OffsetRegularisation, PriorOnlySolution
from baryscope.estimator.pivot.pivot_solution import LastStep, PivotSolution, spurious_of_known
from baryscope.estimator.pivot.reduced import scaled, stepped
from baryscope.estimator.pivot.tie_points import tie_bodies
from baryscope.estimator.registration.body import Body, places_of

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MAX_ROUNDS = 30  # of steps and new weights: what has not converged then says so
WANDERING = 12  # rounds after which steps, with weights that are at rest, follow noise in a direction that is not told
FIRM_ROUNDS = 15  # more, at most, once the prior of the offsets holds these against spurious information
STEP_TOLERANCE = 0.1  # squared length of the last step, in units of the covariance of all unknowns
NEARLY, LONGEST = 1.0, 60  # the same of a step that is near the end, so that rounds are added, and of these the most
ROUNDING = 1e-10  # relative to the distance: residuals below this are rounding errors
LASTING_TOLERANCE = 0.1  # relative change of the number of frames with the same errors
SHIFT_TOLERANCE = 0.01  # relative change of an observation's variance, over which the frames' shifts are told
SIMPLE_ROUNDS = 6  # iterations with a simple path, at most, in which the weights settle
FREE_ROUNDS = 10  # iterations after which changes of the weights are damped


def refined(start: InitialSolution, options: PathOptions) -> PivotSolution:
    """The solution of Gauss–Newton steps until steps and changes of the weights are small, with tie points applied.

    Raises:
        ComputationError: too few values for the unknowns.
    """
    search = _Refinement(start, options)
    while not search.converged and search.rounds < search.most:
        search.go_on()
    return search.found()


class _Refinement:
    """The iteration, with where it is and what it takes for given until it has converged.

    bodies, with points from the centre of mass, and x (p,) of the path, sampled at all times; observations with their
    robust weights; theta (h,): the likeliest hyperparameters of the path's prior; variance: of an observation of
    weight 1, from the residuals; simple: the prior of a simple path, while the weights settle; scan: whether the
    hyperparameters are sought in their whole ranges, if there are several, as in the first round and in the last.

    Given, and looked at again once the steps have converged: errors, those that last or that a frame shares;
    regularisation: what holds the offsets, and offset_information (k, 3, 3) how firmly; prior_only: the solution before
    they were held against spurious information. Lost bodies are brought back once, and so are lost attitudes (posed)
    and frames of few features.

    here: from where a step led, while it may be too long, and how often it was halved. Of the last step there are the
    problem, the solution, the variance `together` of what all frames tell for it, its cost, and its decrease, `last`;
    faster: whether that was greater than that of the step before.
    """

    def __init__(self, start: InitialSolution, options: PathOptions) -> None:
        self.start, self.options = start, options
        self.path, self.bodies, self.x = start.path, start.bodies, start.x
        own = start.observations
        self.observations = own if start.weight is None else own.weighted(start.weight)
        self.sampled = as_seen(start.path, start.sampled, start.errors, start.x)
        self.theta: FloatArray | None = None
        self.variance, self.path_unknowns = np.nan, np.nan
        self.floor = least_variance(start.measured, ROUNDING)
        self.stereo: StereoNoise | None = None
        if start.measured.precision is not None:
            self.stereo = stereo_noise(start.measured, self._places(), options.noise, (options.sigma or 1.0) ** 2)
        self.inliers, self.simple, self.scan = start.inliers, start.first_prior, True
        self.errors = LastingAndShared(start.lasting, Slip(start.slip))
        self.regularisation = OffsetRegularisation.of(start.bodies)
        self.prior_only: PriorOnlySolution | None = None
        self.brought_back, self.posed, self.extended = False, False, False
        self.here: StepStart | None = None
        self.halvings, self.rounds, self.most, self.converged = 0, 0, MAX_ROUNDS, False
        self.last: LastStep | None = None
        self.faster = False

    def go_on(self) -> None:
        """One round: a step, halved as long as it is too long, new weights, and what has to hold at the end."""
        self.rounds += 1
        problem = self._linearised()
        if self._leads_uphill(problem):
            return
        dof = self._step(problem)
        self._reweight(dof)
        settled = self._is_within(STEP_TOLERANCE)
        self.converged = settled and self.simple is None and (self.scan or len(self.path.prior.hyperparameters) < 2)
        self.scan = settled
        if self.simple is not None:
            self.scan = settled or self.rounds >= SIMPLE_ROUNDS
            if self.scan:
                self.simple, self.theta, self.here = None, None, None
        self.converged = self.converged and self._is_complete() and self._is_consistent()
        # Where whole steps go to and fro, half of one comes to rest between.
        if self._goes_round() and not self._slips_otherwise(more=True) and self.here is not None:
            self._move(*self.here.halfway(self.bodies, self.x))
        self._hold_offsets()
        if not self.converged and self.rounds == self.most < LONGEST and self._is_within(NEARLY):
            self._go_on_for(FIRM_ROUNDS)

    def _linearised(self) -> Linearised:
        """The problem where the iteration is, with what depends on the place."""
        start = self.start
        if self.stereo is not None:
            self.observations = self.stereo.moved_to(self._places(), self.observations.weight)
        sigma = self.options.sigma
        frame_variance = max(sigma**2 if sigma else self.variance, self.floor)
        self.errors = self.errors.at(start.errors, self._origin(), frame_variance)
        of_frame = max(start.variance if np.isnan(self.variance) else self.variance, self.floor)
        self.offset_information = self.regularisation.information(of_frame, self.errors.lasting)
        shifts = self.errors.shifts
        return linearised(self.bodies, self.observations, self.sampled, self.x, shifts, self.offset_information)

    def _leads_uphill(self, problem: Linearised) -> bool:
        """Whether the linearised problem did not hold as far as the last step went, which is then halved."""
        last_one = self.halvings == MOST_HALVINGS or self.rounds == self.most  # which ends with a step
        if self.here is None or last_one or not self.here.is_worse(problem, self.observations.weight):
            self.halvings = 0
            return False
        self.halvings += 1
        self._move(*self.here.halfway(self.bodies, self.x))
        return True

    def _step(self, problem: Linearised) -> float:
        """A step with the likeliest hyperparameters, and the variance after it; returns the degrees of freedom."""
        self.problem, self.cost = problem, float(problem.squares.sum())
        prior = self.path.prior if self.simple is None else self.simple
        if np.isnan(self.variance):
            free = float(self.path.prior.free.sum())
            self.variance = self.cost / degrees_of_freedom(self.bodies, self.observations, free)
        self.together = self.errors.lasting * self.least
        self.theta = improved(scaled(problem, self.together), prior, self.theta, scan=self.scan)
        self.solution = stepped(problem, prior, self.theta, self.together)
        self._move(self.solution.bodies, self.solution.x)
        if self.regularisation.firm is None:  # else what holds the offsets tells some
            self.path_unknowns = float(np.vdot(self.solution.covariance, problem.matrix))
        dof = degrees_of_freedom(self.bodies, self.observations, self.path_unknowns)
        self.variance = (self.cost + problem.noise_cost) / dof
        if self.start.measured.precision is not None:
            precision = held(scaled(problem, self.together), prior, self.theta)[0]
            self.here = StepStart(problem, self.observations.weight, self.least, self.errors.lasting, precision)
        return dof

    def _reweight(self, dof: float) -> None:
        """The robust weights of the residuals before the step, and what this tells of convergence."""
        solution, before = self.solution, self.observations.weight
        weight = without_scraps(self.bodies, reweighted(solution.squares, before, dof, self.floor))
        if self.rounds > FREE_ROUNDS:  # damping makes oscillating weights converge
            weight = np.sqrt(weight * before)
        unweighted = solution.squares / np.where(weight > 0, before, 1.0)
        changed = abs(float(np.vdot(unweighted, weight)) - self.cost)
        self.faster = self.last is not None and solution.decrease > self.last.decrease
        self.last = LastStep(
            solution.decrease,
            self.problem.offset_change(solution),
            # The first round knows neither weights nor variance.
            self.rounds > 1 and changed <= WEIGHT_CHANGE_TOLERANCE * max(self.cost, self.floor * dof),
        )
        self.observations = self.observations.weighted(weight)

    def _is_within(self, tolerance: float) -> bool:
        """Whether the last step and the last change of weights are small."""
        assert self.last is not None  # noqa: S101  there was a step
        return self.last.steady and self.last.decrease <= tolerance * self.least

    def _is_complete(self) -> bool:
        """Whether bodies, frames, modes of the path and no untold features are there; if not, they are from now on."""
        if self.rounds == self.most:
            return True
        joins = not self.brought_back and self._bring_back_bodies()
        joins = joins or (not self.posed and self._find_attitudes())
        joins = joins or (not self.extended and self._add_few_features()) or self._enrich_path()
        changed = joins or self._leave_untold_features()
        if changed:
            self.here = None
        return not changed

    def _bring_back_bodies(self) -> bool:
        """Whether a body is lost, which is then at the path again."""
        start, weight = self.start, self.observations.weight
        near = brought_back_bodies(
            self.bodies, weight, start.bodies, start.registered, start.observations, self._origin()
        )
        if near is not None:
            near = regained(near, self.bodies, self.observations, self.sampled, self.x, self.floor)
        self.brought_back = near is not None
        self.extended = self.extended and not self.brought_back  # its frames of two features may join at the path
        return self._take(near)

    def _find_attitudes(self) -> bool:
        """Whether frames of which some is rejected fit the path clearly better with attitudes that they then have."""
        self.posed = True
        at = self.bodies, self.observations.weight, self.start.measured, self._origin(), self.least
        return self._take(with_found_attitudes(*at))

    def _add_few_features(self) -> bool:
        """Whether frames that show two features join a body."""
        self.extended = True
        weight, variance = self.observations.weight, self.errors.lasting * self.least
        measured = self.start.measured
        return self._take(with_few_features(self.solution, weight, measured, self.sampled, variance, self._spurious))

    def _take(self, found: tuple[tuple[Body, ...], FloatArray] | None) -> bool:
        """Whether there are other bodies and weights (n, m), which then take the place of those before."""
        if found is None:
            return False
        self.bodies, weight = found
        self.observations = self.observations.weighted(weight)
        return True

    def _leave_untold_features(self) -> bool:
        """Whether features of which all observations are rejected leave their bodies."""
        before = self.observations.weight
        left = self._take(None if self.prior_only is not None else without_untold_features(self.bodies, before))
        self.inliers = self.inliers & ~((before > 0) & (self.observations.weight == 0))
        return left

    def _enrich_path(self) -> bool:
        """Whether the tracks tell modes of process noise that the path leaves out; then it has them."""
        assert self.theta is not None  # noqa: S101  there was a step
        richer = enriched(self.path, self.theta, np.diag(self.problem.matrix) / self.together)
        if richer is None:
            return False
        self.path = richer
        self.x = np.pad(self.x, (0, self.path.size - len(self.x)))
        sampled = interpolated(self.path.at, self.path.frequency, self.start.time)
        self.sampled = as_seen(self.path, sampled, self.start.errors, self.x)
        return True

    def _is_consistent(self) -> bool:
        """Whether a rig's noise, slip, the errors' duration and the frames' shifts are those that were taken for given.

        Those that are not are taken anew.
        """
        if self.stereo is not None and self.options.sigma is None:
            before, self.stereo = self.stereo, self.stereo.of_variance(self.least)
            if self.stereo is not before:
                self.here = None
                return False
        given, at = self.errors, (self.bodies, self.observations, self._origin())
        if self._slips_otherwise():
            return False
        lasting = frames_per_error(*at)
        self.errors = replace(self.errors, lasting=lasting)
        if abs(lasting - given.lasting) > LASTING_TOLERANCE * max(lasting, given.lasting):
            self.here = None
            return False
        if given.shifts is None or self.options.sigma is not None:
            return True
        return abs(lasting * self.variance - given.told) <= SHIFT_TOLERANCE * given.told

    def _slips_otherwise(self, *, more: bool = False) -> bool:
        """Whether the slip is another than was taken for given, or greater if `more`; then it is taken anew."""
        if not self.start.slips:
            return False
        given = self.errors
        slow = self.path.name != "relative-orbit"
        found = given.slipping(self.bodies, self.observations, self._origin(), self.least, slow=slow)
        if more and not found.slip.variance > given.slip.variance:
            return False
        self.errors = found
        if not found.slips_unlike(given):
            return False
        self.here = None  # what the last step has led to is of another noise
        # All that was found without may be far from what is found with it, and less of it with another.
        self._go_on_for(MAX_ROUNDS if given.slip.variance == 0 else min(FIRM_ROUNDS, max(LONGEST - self.rounds, 0)))
        return True

    def _goes_round(self) -> bool:
        """Whether steps are long where they should have come to rest, on a path that may follow slips.

        Without their noise steps may lead from a path that follows slips, with wrong offsets, to one that does not, and
        back, each likelier from where the other is. Then what the latter leaves tells the slips.
        """
        assert self.last is not None  # noqa: S101  there was a step
        follows = self.simple is None and len(self.path.prior.hyperparameters) > 0
        return follows and self.rounds >= WANDERING and self.last.decrease > NEARLY * self.least

    def _hold_offsets(self) -> None:
        """Hold the offsets against spurious information where the iteration ends, or wanders in what is not told.

        Where that leads to squares that noise does not make, the offsets are told after all: back to their prior alone.
        """
        assert self.last is not None  # noqa: S101  there was a step
        together, simple = self.errors.lasting * self.least, self.simple is not None
        # Steps that become longer lead to a place that the tracks do tell.
        at_rest = self.last.steady and not self.faster and not simple
        wandering = self.regularisation.firm is None and at_rest and self.rounds >= WANDERING
        contradicted = self.prior_only is not None and self.cost > self.prior_only.cost + CONTRADICTED * together
        if not (self.converged or wandering or contradicted):
            return
        if self.prior_only is not None and self.prior_only.is_told(
            self.problem.bodies, self.cost, together, self._spurious
        ):
            prior_only, self.prior_only = self.prior_only, None
            self.regularisation = self.regularisation.of_prior_alone()
            self._go_on_for(MAX_ROUNDS)
            self._move(prior_only.bodies, np.pad(prior_only.x, (0, self.path.size - len(prior_only.x))))
        # Not before: far from the solution, and with outliers, what is told may seem spurious.
        elif self.converged or wandering:
            firmer = self.regularisation.firmer(
                self.least,
                self.errors.lasting,
                self.solution.offset_covariance,
                self.offset_information,
                self._spurious,
            )
            if firmer is None:
                return
            if self.regularisation.firm is None:
                self.prior_only = PriorOnlySolution.of(self.bodies, self.x, self.cost, self._spurious)
            self.regularisation = firmer
            self._go_on_for(FIRM_ROUNDS)

    def found(self) -> PivotSolution:
        """The solution, with the covariance for unknown hyperparameters and with tie points."""
        assert self.theta is not None and self.last is not None  # noqa: S101, PT018  there was a round
        scale = self.options.sigma**2 if self.options.sigma is not None else self.variance
        of_frame = max(scale, self.floor)
        together = self.errors.lasting * of_frame
        found = posterior(scaled(self.problem, together), self.path.prior, self.theta)
        solution, tied, refused = tie_bodies(
            self.solution.with_covariance(found.covariance / together, self.problem.bodies),
            together,
            self.observations,
            self._origin(),
            self.errors.shifts,
            frame_variance=of_frame,
        )
        return PivotSolution(
            path=self.path,
            sampled=self.sampled,
            time=self.start.time,
            inliers=self.inliers,
            solution=solution,
            untied=self.solution,
            observations=self.observations,
            frame_variance=scale,
            residual_variance=self.variance,
            lasting=self.errors.lasting,
            shifts=self.errors.shifts,
            posterior=found,
            path_unknowns=self.path_unknowns,
            converged=self.converged,
            rounds=self.rounds,
            regularisation=self.regularisation,
            offset_information=self.offset_information,
            stereo=self.stereo is not None,
            slip=self.errors.slip,
            tie_points=tied,
            refused=refused,
            last=self.last,
        )

    @property
    def least(self) -> float:
        """The variance of an observation of weight 1, at least that of rounding."""
        return max(self.variance, self.floor)

    def _origin(self) -> FloatArray:
        """The path (n, 3) in C, m, as the camera sees it."""
        return self.sampled.position(self.x)

    def _places(self) -> FloatArray:
        """The estimated positions (n, m, 3) in C, m; the measured ones where no body has the feature."""
        return places_of(self.bodies, self._origin(), self.start.measured.position)

    def _move(self, bodies: tuple[Body, ...], x: FloatArray) -> None:
        """Go to bodies and x (p,)."""
        self.bodies, self.x = bodies, x
        self.sampled = as_seen(self.path, self.sampled.itself, self.start.errors, x)

    def _go_on_for(self, rounds: int) -> None:
        """Not converged yet, for so many rounds more at most."""
        self.most, self.converged, self.here = self.rounds + rounds, False, None

    def _spurious(self) -> Sequence[FloatArray]:
        """The spurious information (3, 3) on each body's offset, in the weights' units."""
        return spurious_of_known(self.bodies, self.observations, self._origin(), self.least, self.errors.shifts)

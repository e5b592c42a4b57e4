"""Whether a path needs its process noise, and whether it may follow the rotation.

The significance of a hyperparameter is twice the logarithm of the likelihood ratio against no effect. Without an effect
it is 0 in half of all cases, and χ² with one degree of freedom in the others (Self and Liang 1987).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.diagnostics import main_cluster
from baryscope.estimator.findings import FollowsRotation
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.observability import PrincipalAxes
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.process_noise import DENSITY, ProcessNoisePath
from baryscope.estimator.paths.trajectory import smooth_in
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.joint_covariance import SPURIOUS, JointCovariance
from baryscope.estimator.pivot.pivot_solution import SIGNIFICANT, PivotSolution
from baryscope.estimator.pivot.reduced import bounded_cost
from baryscope.estimator.pivot.refinement import refined
from baryscope.estimator.registration.noise import GATE
from baryscope.models.errors import ComputationError

FloatArray = NDArray[np.float64]

FAINT = 1e-30  # m²/s³: a density without effect
FEIGNED = 0.4  # share of the information on an offset that is spurious, where a path may follow the rotation
PARTLY_FEIGNED = 0.1  # the same, in other directions: where one is wrong, they are
HARMLESS = 0.5  # claim over the features' radius: the offset is off by some two radii, four deviations, at most
BY_CHANCE = 5.0  # deviations of the noise of a sum of squares, from one place to that where it is least
CURVED = 12.0  # unknowns of a smooth path that the tracks determine: more than those of a cubic may follow it


def with_needed_noise(found: PivotSolution, start: InitialSolution, options: PathOptions) -> PivotSolution:
    """The solution, or that which is reached from one without process noise, if it is likelier by more than chance.

    Where hardly more than noise tells the offsets, steps that may use process noise can end with wrong offsets that
    need it. Without it they come near the right ones. The more modes it has, the more of such offsets it makes likely:
    where much is feigned, that with the fewest is compared.

    A path that follows the rotation may be likelier, as it follows the attitudes' noise, too. But that there are other
    offsets, with which the path needs no noise at all, would be a far greater chance, if these are wrong: so they need
    not be likelier where much is feigned, and chance makes the squares as much less.
    """
    path = start.path
    if not isinstance(path, ProcessNoisePath) or path.density is not None or smooth_in(path) is not None:
        return found
    if not (found.converged and found.has(DENSITY)) or found.shown_spurious_share < SPURIOUS:
        return found
    try:
        quiet = refined(replace(start, path=replace(path, density=FAINT), first_prior=None), options)
        near = replace(start, bodies=quiet.bodies, x=quiet.solution.x, observations=quiet.observations, weight=None)
        other = refined(replace(near, first_prior=path.prior.holding({DENSITY: np.log(FAINT)})), options)
        gain = gain_over(found, other, start)
        if gain <= SIGNIFICANT and found.path.size > path.size and found.shown_spurious_share > FEIGNED:
            gain = gain_over(refined(replace(start, path=replace(path, most=path.count)), options), other, start)
    except ComputationError:
        return found
    if gain > SIGNIFICANT:
        return other
    quiet_enough = found.shown_spurious_share > FEIGNED and other.converged and not other.has(DENSITY)
    return other if quiet_enough and squares_by_chance(found, other) else found


def gain_over(found: PivotSolution, other: PivotSolution, start: InitialSolution) -> float:
    """What −2 ln of the marginal likelihood of a start's observations is less by in another solution than in one.

    For the least variance of both. Frames of two features that only one has found a place for are no evidence for it.
    """
    variance = min(found.variance, other.variance)
    return _cost_of(found, start, variance) - _cost_of(other, start, variance)


def is_better(found: PivotSolution, other: PivotSolution, start: InitialSolution) -> bool:
    """Whether one solution is better than another, from a start: it alone has converged, or it is likelier."""
    if found.converged != other.converged:
        return found.converged
    return gain_over(other, found, start) > 0


def _cost_of(found: PivotSolution, start: InitialSolution, variance: float) -> float:
    """−2 ln of the marginal likelihood, up to a constant, of the observations of a start, with outliers of a bounded
    cost. Tie points are none of them: they move the path's noise to where it is unlikely, if it is that of none.
    """
    weight = np.where(start.observations.weight > 0, found.observations.weight, 0.0)
    return bounded_cost(found.untied_problem, weight, variance, found.path.prior, found.posterior.theta)


def following_rotation(
    found: PivotSolution, joint: JointCovariance
) -> tuple[JointCovariance, tuple[FollowsRotation, ...]]:
    """The joint covariance of a solution, wider where its path may follow the rotation; and the finding of that.

    Where hardly more than noise tells the offset, attitudes that outliers have spoilt, or that turn little, can make
    such a path likelier than the true one, with an offset that is wrong by as much as the features are apart: the cost
    near by tells nothing of that. It may be so of significant process noise, and of a smooth path that is much curved.
    What is feigned of the offset of the main body, if only in part, and claimed to within HARMLESS of the features'
    radius, is claimed to that instead; and so is the path, which has followed it where attitudes are seen, and in gaps
    may be anywhere between.
    """
    main = main_cluster(found.bodies)
    own, most = slice(3 * main, 3 * main + 3), HARMLESS * rms_radius(found.bodies[main].points)
    axes = PrincipalAxes.of(joint.of_offsets[main])
    told = axes.directions[axes.deviations <= most]
    free = found.has(DENSITY) if smooth_in(found.path) is None else found.path_unknowns > CURVED
    if not (free and len(told)):
        return joint, ()
    shares, measures = found.shown_spurious_shares(main, told)
    if shares.max(initial=0.0) <= FEIGNED:
        return joint, ()
    feigned = measures[:, shares > PARTLY_FEIGNED]
    claimed = np.einsum("id,ij,jd->d", feigned, joint.matrix[own, own], feigned)
    missing = np.maximum(most**2 * np.sum(feigned**2, axis=0) - claimed, 0.0)
    solution = found.solution
    changes = np.concatenate([solution.offset_covariance[:, own], solution.offset_path[own].T]) @ feigned
    follows = FollowsRotation(float(shares[-1]), found.path_unknowns)
    return joint.grown(changes * np.sqrt(missing)).displaced(most, found.sampled.itself), (follows,)


def squares_by_chance(found: PivotSolution, other: PivotSolution) -> bool:
    """Whether noise alone may make the sum of squares of one solution so much less than that of another (Vuong 1989).

    Both are of the frames' own noise: what one frame has less of in one of them says nothing of the next one.
    """
    used = (found.observations.weight > 0) & (other.observations.weight > 0)
    variance = min(found.frame_variance, other.frame_variance)
    less = np.where(used, _bounded(other, variance) - _bounded(found, variance), 0.0).sum(axis=1)
    deviation = float(np.sqrt(found.lasting * len(less) * less.var()))
    return float(less.sum()) <= BY_CHANCE * deviation


def _bounded(found: PivotSolution, variance: float) -> FloatArray:
    """The squared residuals (n, m) of observations, over their variance, with outliers of a bounded cost."""
    weight = found.observations.weight
    squares = np.divide(found.untied_problem.squares, weight, out=np.zeros_like(weight), where=weight > 0)
    return np.minimum(squares / variance, GATE)

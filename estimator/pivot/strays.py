"""The solution without the frames in which attitudes stray from the rotation, or rest on rejected observations.

Where the centre of mass is observed poorly, the noise of such attitudes outweighs what the rotation tells of it. Of
three features of which one is rejected, two turn about their line as path and offset have it, whatever these are.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.attitude_noise import strays
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import REJECTED
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.joint_covariance import SPURIOUS
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.refinement import refined
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import MIN_FRAMES
from baryscope.models.errors import ComputationError

BoolArray = NDArray[np.bool_]

REPEATS = 3  # of search and refinement, at most


def without_strays(
    found: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution without the frames in which a body's attitude strays or hardly is one, if they matter, and its
    start.
    """
    for _ in range(REPEATS):
        if found.shown_spurious_share < SPURIOUS:
            break
        known, bodies = np.where(found.observations.weight > 0, start.observations.weight, 0.0), []
        weight = known.copy()
        astray = strays(found.bodies, found.observations, found.time, found.frame_variance, found.shifts)
        for body, stray in zip(found.bodies, astray, strict=True):
            stray |= _rest_on_rejected(body, found.observations)
            stray &= (~stray).sum() >= MIN_FRAMES
            weight[np.ix_(body.frames[stray], body.features)] = 0.0
            bodies.append(body.in_frames(_is_begun_with(body, start) & ~stray))
        if np.array_equal(weight, known):
            break
        first = None if start.weight is None else np.where(weight > 0, start.weight, 0.0)
        own = start.observations.weighted(weight)
        fewer = replace(start, bodies=tuple(bodies), observations=own, inliers=found.inliers, weight=first)
        try:
            found = refined(replace(fewer, x=found.solution.x[: start.path.size]), options)
        except ComputationError:
            break
        start = fewer
    return found, start


def _rest_on_rejected(body: Body, observations: Observations) -> BoolArray:
    """In which frames (n,) of a body an attitude is left without enough features where others are rejected."""
    weight = observations.weight[body.block]
    return np.asarray(((weight > 0).sum(axis=1) >= FEWEST_POINTS) & ((weight >= REJECTED).sum(axis=1) < FEWEST_POINTS))


def _is_begun_with(body: Body, start: InitialSolution) -> BoolArray:
    """In which frames (n,) of a body there were observations from the start: those of two features join it later."""
    return np.asarray((start.observations.weight[body.block] > 0).any(axis=1))

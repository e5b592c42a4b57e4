"""What tracks tell of a smooth path where attitudes are those of a smooth rotation.

Errors of the attitudes hold the offsets, and with them the path, to where the iteration has ended: they turn an offset
as no smooth path could. Attitudes that are fitted to those near have less of them, so that a path that follows the
rotation, with another offset, is nearly as likely. Then the orbit tells which it is.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.attitude_noise import departures_of
from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood
from baryscope.estimator.paths.path import SmoothPath
from baryscope.estimator.pivot.drift import drift_equations
from baryscope.estimator.pivot.offset_prior import RADII, radius_of_many
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered

FloatArray = NDArray[np.float64]


def by_smooth_rotation(found: PivotSolution, smooth: SmoothPath) -> GaussianLikelihood | None:
    """What the places of a solution's bodies tell of the coefficients (p,) of its smooth path; None without neighbours.

    Linear about the solution's own, with the prior of the offsets, and one variance for all axes of a place: with that
    of the attitude times the prior's arm. A fit's errors are less, but those of neighbours are alike.
    """
    arm = RADII * max(radius_of_many(body.points) for body in found.bodies)
    bodies, origins, roots = [], [], []
    for body in found.bodies:
        departures = departures_of(body, found.observations, found.time, found.frame_variance, found.shifts)
        turned = body.attitude @ exp_rotation(departures.turn)
        own = replace(body, attitude=turned, points=body.points - body.points.mean(axis=0))
        weight = _weights(own, found)
        used = departures.tested & (weight.sum(axis=1) > 0)
        if used.any():
            own, weight = own.in_frames(used), weight[used]
            seen = found.observations.position[own.block]
            seen = seen - own.points @ np.swapaxes(own.attitude, 1, 2)
            total = weight.sum(axis=1)
            bodies.append(own)
            origins.append(np.einsum("nm,nmi->ni", weight, seen) / total[:, None])
            turn = np.trace(departures.expected[used], axis1=1, axis2=2) / (3 * found.frame_variance)
            roots.append(1 / np.sqrt(1 / total + turn * arm**2))
    if not bodies:
        return None
    noise = float(np.sqrt(found.variance))
    registered = Registered(tuple(bodies), tuple(origins), noise)
    equations = drift_equations(registered, roots, smooth.at(found.time), noise)
    return equations.of_path(found.variance, found.solution.x[: smooth.size])


def _weights(body: Body, found: PivotSolution) -> FloatArray:
    """The weights (n, m) of a body's observations, for all axes alike."""
    own = found.observations.frames(body.frames).features(body.features)
    if own.precision is None:
        return own.weight
    return np.asarray(own.weight * np.trace(own.precision, axis1=2, axis2=3) / 3)

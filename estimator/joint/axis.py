"""The axis of a hinge: R_P_C a_C = a_P at all times (SARA: Ehrig, Taylor, Duda and Heller, J. Biomech. 40, 2007).

The axis is the null vector of the centre's equations. Its directions' covariance is that of small turns of both sides,
by the restricted likelihood of the differences across the axis (`noise`), at all frequencies at which the bodies turn.
Skin that turns a body's markers by k θ where the bodies turn by θ about a makes a + k the axis, and leaves no
difference across it. What of the markers' own errors follows the motion tells how large such turns are likely to be.
"""

import numpy as np

from baryscope.estimator.joint.bodies import Pair
from baryscope.estimator.joint.ml import (
    angles,
    clear_coefficients,
    motion_functions,
    relative_noise,
    relative_turn_with_motion,
)
from baryscope.estimator.joint.noise import restricted_likelihood
from baryscope.estimator.joint.result import HingeAxis
from baryscope.estimator.tracks import FloatArray

CLEAR = 10.0  # least power of the turn over that of the attitudes' noise, which harms an axis less than a centre
STEPS = 3  # of Gauss and Newton


def hinge_axis(pair: Pair) -> HingeAxis:
    """The axis about which parent and child turn, if they turn about one."""
    R = pair.relative
    mean = R.mean(axis=0)
    both = np.linalg.eigh(np.block([[np.eye(3), -mean], [-mean.T, np.eye(3)]]))[1][:, 0]
    in_parent, in_child = both[:3] / np.linalg.norm(both[:3]), both[3:] / np.linalg.norm(both[3:])
    kept = clear_coefficients(pair, CLEAR)
    functions = motion_functions(pair, [np.broadcast_to(np.eye(2), (len(R), 2, 2))])
    for _ in range(STEPS):
        P, C = _across(in_parent), _across(in_child)
        # a_P + P x = R (a_C + C y), across the axis
        design = np.concatenate([np.broadcast_to(np.eye(2), (len(R), 2, 2)), -P.T @ R @ C], axis=2)
        wanted = (R @ in_child - in_parent) @ P
        fit = restricted_likelihood(design, wanted, functions, kept)
        in_parent, in_child = in_parent + P @ fit.found[:2], in_child + C @ fit.found[2:]
        in_parent, in_child = in_parent / np.linalg.norm(in_parent), in_child / np.linalg.norm(in_child)
    noise = float(in_child @ relative_noise(pair).mean(axis=0) @ in_child)  # which also looks like a turn
    turned = float(np.sqrt(max(np.var(angles(R) @ in_child) - noise, 0.0)))
    by_skin = relative_turn_with_motion(pair).mean(axis=0)  # of k θ, which is as long as θ at most
    of_skin = by_skin / max(turned**2, float(np.linalg.eigvalsh(by_skin)[2]), 1e-300)
    in_parents = mean @ of_skin @ mean.T
    return HingeAxis(
        in_parent=in_parent,
        in_child=in_child,
        covariance_in_parent=P @ (fit.covariance[:2, :2] + P.T @ in_parents @ P) @ P.T,
        covariance_in_child=C @ (fit.covariance[2:, 2:] + C.T @ of_skin @ C) @ C.T,
        residual=float(np.sqrt(np.mean(((R @ in_child - in_parent) @ P) ** 2))),
        turned=turned,
    )


def _across(axis: FloatArray) -> FloatArray:
    """Two unit vectors (3, 2) across an axis and each other."""
    return np.linalg.svd(axis[None])[2][1:].T

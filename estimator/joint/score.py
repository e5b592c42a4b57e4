"""SCoRE (Ehrig, Taylor, Duda and Heller, J. Biomech. 39, 2006), two-sided: least squares of both offsets.

Skin moves slowly and markers of a segment move together, so the residuals of neighbouring frames are not independent:
the covariance is that of Newey and West (Econometrica 55, 1987), prewhitened (Andrews and Monahan, Econometrica 60,
1992) by a first-order process.
Noise of the attitudes seems to tell where on a hinge's axis the centre is. That information is taken back (see
`adjustment.spurious`), as if markers moved each by itself by as much as the joint's residuals are.
What keeps time with the motion, as skin that shifts with the joint's angle, looks like a shift of the centre, and
leaves smaller residuals than it has errors. Its variance is that of `ml`, and what least squares makes of it is added.
The scores are without what of the residuals is likeliest to be of it, as that would count twice.
"""

import numpy as np

from baryscope.estimator.adjustment.autocorrelation import integrated_autocorrelation
from baryscope.estimator.adjustment.spurious import SpuriousInformation, farthest, spurious_information_columns
from baryscope.estimator.geometry.so3 import squared_cross
from baryscope.estimator.joint.bodies import Pair
from baryscope.estimator.joint.ml import likeliest_slide
from baryscope.estimator.joint.result import Centre, untold
from baryscope.estimator.tracks import FloatArray

LAGS = 10  # of Bartlett's weights on the whitened scores


def score(pair: Pair, told: FloatArray) -> Centre:
    """The centre by least squares; told (6, q): the directions of (u, v) of which the motion tells, if by the bodies'
    noise alone.
    """
    design, wanted = pair.equations
    normal = np.einsum("kij,kil->jl", design, design)
    inverse = told @ np.linalg.inv(told.T @ normal @ told) @ told.T
    found = inverse @ np.einsum("kij,ki->j", design, wanted)
    residual = design @ found - wanted
    fit, in_child, groups = likeliest_slide(pair, told)
    slide = np.einsum("kij,kj->ki", pair.child.rotation if in_child else pair.parent_pose[0], fit.locked)
    rest = residual + slide - design @ (inverse @ np.einsum("kij,ki->j", design, slide))
    frames, _ = integrated_autocorrelation([rest])
    independent = len(residual) / frames
    spurious = SpuriousInformation.of(_spurious(pair, residual), max(int(independent), 1))
    variance = float(np.mean(residual**2)) * frames
    reach = farthest(pair.child.markers)
    free, _ = spurious_information_columns(inverse, np.zeros((6, 0)), spurious, variance / reach**2)
    scores = np.einsum("kij,ki->kj", design, rest)
    memory = (frames - 1) / (frames + 1)  # of a first-order process with that integrated autocorrelation
    innovation = (scores[1:] - memory * scores[:-1]) / (1 - memory)
    meat = innovation.T @ innovation
    for lag in range(1, LAGS):
        product = innovation[lag:].T @ innovation[:-lag]
        meat += (1 - lag / LAGS) * (product + product.T)
    freedom = 3 * independent / max(3 * independent - 6, 1.0)
    covariance = freedom * (inverse @ meat @ inverse + variance * free @ free.T) + untold(told, reach)
    for variance_of_group, functions in zip(fit.variances, groups, strict=True):
        shift = inverse @ np.einsum("kij,kiq->jq", design, functions)
        covariance += variance_of_group * shift @ shift.T
    values, vectors = np.linalg.eigh(normal)
    weakest = vectors[:, 0]
    observable = told.shape[1] == len(values) and values[0] > weakest @ spurious.likely @ weakest
    return Centre(found, covariance, bool(observable), weakest)


def _spurious(pair: Pair, residual: FloatArray) -> FloatArray:
    """The information on (u, v), (6, 6), that the noise of attitudes seems to give."""
    found = np.zeros((6, 6))
    bodies = [(slice(3, 6), pair.child)]
    if pair.parent is not None:
        bodies.append((slice(0, 3), pair.parent))
    for own, body in bodies:
        # The joint's residual is of the centroids of all bodies; as one of a marker by itself it is larger.
        of_markers = np.mean(residual**2) * body.weights.sum(axis=1).mean() / len(bodies)
        of_turn = body.attitude_noise(float(max(of_markers, np.mean(body.rms**2)))).sum(axis=0)
        found[own, own] = squared_cross(of_turn)
    return found

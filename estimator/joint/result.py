"""What is found of a joint."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from baryscope.estimator.joint.bodies import Pair
from baryscope.estimator.tracks import FloatArray

Method = Literal["score", "ml"]


@dataclass(frozen=True)
class Slide:
    """By how much the two sides slide past each other, m rms per coordinate: the joint's slack and skin in one.

    Residuals don't tell the joint's slack from skin that moves with all markers of a segment.

    Attributes:
        white: at all frequencies alike, as beyond those of the motion; of the markers' noise, too.
        correlated: for longer than a frame, in any rhythm.
        locked: as a function of the joint's angles and rates.
        of_markers: what the markers' own noise explains of all that.
    """

    white: float
    correlated: float
    locked: float
    of_markers: float


@dataclass(frozen=True)
class HingeAxis:
    """The axis of a hinge, by SARA (Ehrig, Taylor, Duda and Heller, J. Biomech. 40, 2007): at rest in both bodies.

    Attributes:
        in_parent, in_child: (3,), unit vectors, in the axes of `Joint.in_parent` and `Joint.in_child`.
        covariance_in_parent, covariance_in_child: (3, 3), rad², of these directions; across them.
        residual: rms, rad, by which the two sides differ across the axis: what the joint does besides, and noise.
    """

    in_parent: FloatArray
    in_child: FloatArray
    covariance_in_parent: FloatArray
    covariance_in_child: FloatArray
    residual: float


@dataclass(frozen=True)
class Joint:
    """A centre of rotation.

    Attributes:
        method: score or ml.
        time: (n,), s, of the frames that show both bodies.
        in_parent, in_child: (3,), m, from the markers' centroid, in the axes that the body has in the first common
            frame which shows all of its markers; without a parent in_parent is in the tracks' axes.
        covariance: (6, 6), m², of both, referred to where skin held the markers on average.
        position: (n, 3), m, in the tracks' axes: the mean of the two sides.
        residual: (n, 3), m: the difference of the two sides.
        correlation_time: of the residuals, s.
        effective_frames: how many independent frames weigh as much.
        ratio: of the least to the greatest singular value of the motion.
        hinge: whether the bodies turn about one axis as far as the noise lets tell: along it the centre is less certain
            than a third of the child's markers' radius (ml), or nothing is known (score). Where nothing is known, the
            covariance is that of three radii.
        axis: (3,), in the child's axes: the direction in which the centre is least certain, that of a hinge.
        parent_rms, child_rms: (m,), m, of each marker from the rigid body, per coordinate.
        child_markers: (m, 3), m: their mean shape, in the child's axes.
        slide: of the two sides; None by score.
        hinge_axis: None if it is no hinge.
    """

    method: Method
    time: FloatArray
    in_parent: FloatArray
    in_child: FloatArray
    covariance: FloatArray
    position: FloatArray
    residual: FloatArray
    correlation_time: float
    effective_frames: float
    ratio: float
    hinge: bool
    axis: FloatArray
    parent_rms: FloatArray
    child_rms: FloatArray
    child_markers: FloatArray
    slide: Slide | None
    hinge_axis: HingeAxis | None


@dataclass(frozen=True, eq=False)
class Centre:
    """A method's answer: found (6,) = (u, v), m; covariance (6, 6), m²; hinge; weakest (6,), the least certain
    direction; slide."""

    found: FloatArray
    covariance: FloatArray
    hinge: bool
    weakest: FloatArray
    slide: Slide | None = None


def residual_of(pair: Pair, found: FloatArray) -> FloatArray:
    """The difference (k, 3), m, of the two sides, in T."""
    design, wanted = pair.equations
    return np.asarray(design @ found - wanted)


def joint_of(pair: Pair, method: Method, centre: Centre, ratio: float, axis: HingeAxis | None) -> Joint:
    """The joint, from a method's answer."""
    u, v = centre.found[:3], centre.found[3:]
    R_T_P, c = pair.parent_pose
    residual = residual_of(pair, centre.found)
    frames = frames_per_independent_one(residual)
    return Joint(
        method=method,
        time=pair.time,
        in_parent=u,
        in_child=v,
        covariance=centre.covariance,
        position=(R_T_P @ u + c + pair.child.rotation @ v + pair.child.place) / 2,
        residual=residual,
        correlation_time=frames * float(np.median(np.diff(pair.time))),
        effective_frames=len(residual) / frames,
        ratio=ratio,
        hinge=centre.hinge,
        axis=centre.weakest[3:] / np.linalg.norm(centre.weakest[3:]),
        parent_rms=np.zeros(0) if pair.parent is None else pair.parent.rms,
        child_rms=pair.child.rms,
        child_markers=pair.child.markers,
        slide=centre.slide,
        hinge_axis=axis,
    )


def frames_per_independent_one(residual: FloatArray) -> float:
    """The integrated autocorrelation 1 + 2 Σ ρ, summed to the first lag at which ρ is not positive."""
    total, squares = 1.0, float(np.sum(residual**2))
    for lag in range(1, len(residual) // 2):
        rho = float(np.sum(residual[lag:] * residual[:-lag])) / max(squares, 1e-300)
        if rho <= 0:
            break
        total += 2 * rho
    return total

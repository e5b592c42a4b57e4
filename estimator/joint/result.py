"""What is found of a joint."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from baryscope.estimator.adjustment.autocorrelation import integrated_autocorrelation
from baryscope.estimator.geometry.symmetric import made_definite
from baryscope.estimator.joint.bodies import Body, Pair
from baryscope.estimator.tracks import FloatArray, IntArray
from baryscope.models.words import counted, length

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
        turned: rms, rad, by which the bodies turn about it, without what noise of their attitudes does.
    """

    in_parent: FloatArray
    in_child: FloatArray
    covariance_in_parent: FloatArray
    covariance_in_child: FloatArray
    residual: float
    turned: float

    @property
    def leverage(self) -> float:
        """By how much skin that follows the hinge's angle moves the centre across the axis, in its own rms, nearly.

        To first order a turn by θ about the axis a moves a centre which is off by d across it by θ a × d: skin that
        slides by as much, √(mean θ²) |d| rms, looks the same.
        """
        return 1 / self.turned if self.turned else np.inf

    @property
    def deviation(self) -> float:
        """Standard deviation, rad, of the direction in the child, in the worst direction across it."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance_in_child)[2]))


@dataclass(frozen=True, eq=False)
class Joint:
    """A centre of rotation.

    Attributes:
        method: score or ml.
        pair: the bodies as rigid ones, in the n frames that show both.
        in_parent, in_child: (3,), m, from the markers' centroid, in the axes that the body has in the first common
            frame which shows all of its markers, none left out, as `parent_markers` and `child_markers` are; without a
            parent in_parent is in the tracks' axes.
        covariance: (6, 6), m², of both, referred to where skin held the markers on average.
        position: (n, 3), m, in the tracks' axes: the mean of the two sides.
        residual: (n, 3), m: the difference of the two sides.
        correlation_time: of the residuals, s.
        effective_frames: how many independent frames weigh as much.
        ratio: of the least to the greatest singular value of the motion.
        observable: whether the centre is known in all directions: in none less certain than a third of the child's
            markers' radius (ml), or not known at all (score). Where nothing is known, the covariance is that of three
            radii.
        axis: (3,), in the child's axes: the direction in which the centre is least certain, that of a hinge.
        slide: of the two sides; None by score.
        hinge_axis: where the centre is not observable, and the bodies turn about one axis, and less than half as much
            across it; else None.
    """

    method: Method
    pair: Pair
    in_parent: FloatArray
    in_child: FloatArray
    covariance: FloatArray
    position: FloatArray
    residual: FloatArray
    correlation_time: float
    effective_frames: float
    ratio: float
    observable: bool
    axis: FloatArray
    slide: Slide | None
    hinge_axis: HingeAxis | None

    def __repr__(self) -> str:
        """What was found, and how well it is known, in a line."""
        kind = "a hinge" if self.hinge else "a centre of rotation" if self.observable else "hardly known"
        worst = float(np.sqrt(np.linalg.eigvalsh(self.covariance[3:, 3:])[-1]))
        return f"<Joint by {self.method}: {kind}, {counted(len(self.time), 'frame')}, in the child ±{length(worst)}>"

    @property
    def hinge(self) -> bool:
        """Whether the bodies turn about one axis, along which the centre is hardly known."""
        return self.hinge_axis is not None

    @property
    def time(self) -> FloatArray:
        """(n,), s, of the frames that show both bodies."""
        return self.pair.time

    @property
    def axis_path(self) -> FloatArray | None:
        """(n, 3), unit vectors in the tracks' axes: a hinge's axis in the frames of `time`, the mean of the two sides.

        None of a joint that is no hinge.
        """
        if self.hinge_axis is None:
            return None
        R_T_P, _ = self.pair.parent_pose
        both = R_T_P @ self.hinge_axis.in_parent + self.pair.child.rotation @ self.hinge_axis.in_child
        return np.asarray(both / np.linalg.norm(both, axis=1, keepdims=True))

    @property
    def parent_axes_time(self) -> float | None:
        """As `child_axes_time`, of the parent; None without one, whose axes are those of the tracks."""
        return None if self.pair.parent is None else self._axes_time(self.pair.parent)

    @property
    def child_axes_time(self) -> float:
        """s, of the frame in which the child's axes are those of the tracks, nearly: noise turns them a little."""
        return self._axes_time(self.pair.child)

    def _axes_time(self, body: Body) -> float:
        return float(self.time[np.argmax(body.weights.all(axis=1))])

    @property
    def position_covariance(self) -> FloatArray:
        """(n, 3, 3), m², of `position`, in the tracks' axes.

        That of the centre in both bodies, and that of the sides, a and b, which slide by themselves: their mean is off
        by (a + b) / 2, whose covariance is a quarter of that of a − b, the residual, however much each of them slides.
        """
        R_T_P, _ = self.pair.parent_pose
        design = np.concatenate([R_T_P, self.pair.child.rotation], axis=2) / 2
        slides = self.residual.T @ self.residual / len(self.residual) / 4
        return np.asarray(design @ self.covariance @ np.swapaxes(design, 1, 2) + slides)

    @property
    def parent_rms(self) -> FloatArray:
        """(m,), m, of each marker of the parent from the rigid body, per coordinate; (0,) without a parent."""
        return np.zeros(0) if self.pair.parent is None else self.pair.parent.rms

    @property
    def child_rms(self) -> FloatArray:
        """(m,), m, of each marker of the child from the rigid body, per coordinate."""
        return self.pair.child.rms

    @property
    def attitude_deviation(self) -> float:
        """Standard deviation, rad, of the attitudes by the markers' own noise, in either body's worst direction."""
        bodies = [body for body in (self.pair.parent, self.pair.child) if body is not None]
        noise = [body.attitude_noise(body.own_variance).mean(axis=0) for body in bodies]
        return float(np.sqrt(max(np.linalg.eigvalsh(one)[2] for one in noise)))

    @property
    def parent_left_out(self) -> IntArray:
        """(m,), in how many frames each marker of the parent is seen, but off its body; (0,) without a parent."""
        return np.zeros(0, dtype=np.intp) if self.pair.parent is None else self.pair.parent.left_out.sum(axis=0)

    @property
    def child_left_out(self) -> IntArray:
        """(m,), in how many frames each marker of the child is seen, but off its body, as where labels are swapped."""
        return np.asarray(self.pair.child.left_out.sum(axis=0))

    @property
    def parent_markers(self) -> FloatArray:
        """(m, 3), m: the mean shape of the parent's markers, in its axes; (0, 3) without a parent."""
        return np.zeros((0, 3)) if self.pair.parent is None else self.pair.parent.markers

    @property
    def child_markers(self) -> FloatArray:
        """(m, 3), m: the mean shape of the child's markers, in its axes."""
        return self.pair.child.markers


@dataclass(frozen=True, eq=False)
class Centre:
    """A method's answer: found (6,) = (u, v), m; covariance (6, 6), m²; observable; weakest (6,), the least certain
    direction; slide."""

    found: FloatArray
    covariance: FloatArray
    observable: bool
    weakest: FloatArray
    slide: Slide | None = None


def untold(told: FloatArray, reach: float) -> FloatArray:
    """The covariance (6, 6), m², of (u, v) in the direction that is not among those of which the motion tells, (6, q).

    reach: m, standard deviation of the centre in the child where nothing is known; half of (u, v) is in the child.
    """
    return np.asarray(2 * reach**2 * (np.eye(len(told)) - told @ told.T))


def residual_of(pair: Pair, found: FloatArray) -> FloatArray:
    """The difference (k, 3), m, of the two sides, in T."""
    design, wanted = pair.equations
    return np.asarray(design @ found - wanted)


def joint_of(pair: Pair, method: Method, centre: Centre, ratio: float, axis: HingeAxis | None) -> Joint:
    """The joint, from a method's answer."""
    u, v = centre.found[:3], centre.found[3:]
    R_T_P, c = pair.parent_pose
    residual = residual_of(pair, centre.found)
    frames, _ = integrated_autocorrelation([residual])
    return Joint(
        method=method,
        pair=pair,
        in_parent=u,
        in_child=v,
        covariance=made_definite((centre.covariance + centre.covariance.T)[None] / 2)[0],
        position=(R_T_P @ u + c + pair.child.rotation @ v + pair.child.place) / 2,
        residual=residual,
        correlation_time=frames * float(np.median(np.diff(pair.time))),
        effective_frames=len(residual) / frames,
        ratio=ratio,
        observable=centre.observable,
        axis=centre.weakest[3:] / np.linalg.norm(centre.weakest[3:]),
        slide=centre.slide,
        hinge_axis=axis,
    )

"""What the online estimator answers."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from baryscope.models.words import brief

FloatArray = NDArray[np.float64]


class OnlineStatus(StrEnum):
    """What the state is worth.

    waiting: no frame yet with three features that are not in a line.
    starting: the position of the centre of mass is less certain than the features are far from each other, or what
        only the noise of the attitudes seemed to show is as much as what is known of it along some axis, or fewer
        than six nodes were taken: they have few more values than unknowns.
    tracking: position, velocity and covariance hold. While nothing is in view the covariance grows, and it stays until
        that is too large: then it is `starting` again.
    doubtful: the residuals are larger than the told noise: it is wrong, or features are confused with each other. Or
        the path needs more process noise than the filter has, or, without an orbit, bends steadily.
    lost: the last frame did not fit the map of the features, or fits two attitudes; after ten of those, or three with
        hardly a feature that is in it, the filter begins with another map, and goes on with the path if that was
        known.
    """

    WAITING = "waiting"
    STARTING = "starting"
    TRACKING = "tracking"
    DOUBTFUL = "doubtful"
    LOST = "lost"


@dataclass(frozen=True, eq=False)
class OnlineState:
    """The centre of mass at a time.

    time in s; position (3,) in C, m; velocity (3,) in C, m/s; covariance (6, 6) of both, in m and m/s; attitude (3, 3),
    R_C_B in axes B that are those of C in the first frame of the map, NaN at times without a frame that fits; status;
    density: estimated, of white acceleration, m²/s³; noise_ratio: mean square of the residuals over that of the told
    noise; lasting: how many frames have the same errors of the features, 1 + 2 Σ ρ; the covariance allows for it;
    maps: how many the filter has begun: where it grows, B are other axes;
    thrust (4,): what the thrusters are wrong by, a scale s, and a rotation vector m in their axes, rad: an acceleration
    that is told is (1 + s) exp([m]×) times that; thrust_covariance (4, 4). Zeros before the first push, and if
    thrust_std is 0. execution: what each push is wrong by besides, of its
    own (Gates 1963): the rms of what is likely, in each direction, as a part of the push; 0 without an orbit, before
    the first push, and if thrust_std is 0.
    """

    time: float
    position: FloatArray
    velocity: FloatArray
    covariance: FloatArray
    attitude: FloatArray
    status: OnlineStatus
    density: float
    noise_ratio: float
    lasting: float
    maps: int
    thrust: FloatArray
    thrust_covariance: FloatArray
    execution: float

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class OnlineFeatures:
    """The map: names (m,), positions (m, 3) in B from the centre of mass, m, and their covariances (m, 3, 3)."""

    names: NDArray[np.int64]
    position: FloatArray
    covariance: FloatArray

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class OnlineResiduals:
    """The points of the last frame that the map had: names (k,) as they came, residual (k, 3) in C, m, fits (k,).

    A residual is how far a point is from where the map, as it was, has its feature, in the pose that fits best; NaN in
    a frame for which no pose was found: then no point fits. What does not fit has told the filter nothing.
    """

    names: NDArray[np.int64]
    residual: FloatArray
    fits: NDArray[np.bool_]

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class OnlineTumble:
    """A free tumble at a time.

    attitude (3, 3), R_C_B, with the covariance (3, 3) of its rotation vector in C, rad²; rate (3,) in B, rad/s, with
    its covariance; inertia (3, 3) in B over its trace, with the covariance (5, 5) of its coefficients of
    `baryscope.models.attitude.INERTIA_BASIS`. B is attached to the map of the features: where `maps` of the state
    grows, what is in B is in other axes, while attitude @ rate, in C, can be compared.
    """

    attitude: FloatArray
    attitude_covariance: FloatArray
    rate: FloatArray
    rate_covariance: FloatArray
    inertia: FloatArray
    inertia_covariance: FloatArray

    __repr__ = brief

"""The online estimator: a Kalman filter in C (fmu/csrc/online/) that takes frame after frame, and Python's way to it.

`OnlineEstimator` is what users call; `core` compiles the C once and loads it. `course` has what it tells of tracks that
are there already, `residuals` how a unit's samples are off its map.
"""

from baryscope.estimator.online.answers import (
    OnlineFeatures,
    OnlineResiduals,
    OnlineState,
    OnlineStatus,
    OnlineTumble,
)
from baryscope.estimator.online.estimator import OnlineEstimator, Thrust

__all__ = [
    "OnlineEstimator",
    "OnlineFeatures",
    "OnlineResiduals",
    "OnlineState",
    "OnlineStatus",
    "OnlineTumble",
    "Thrust",
]

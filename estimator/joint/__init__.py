"""The joint between two moving bodies, from the tracks of markers on both: `score`.

Uses geometry, adjustment and tracks.
"""

from baryscope.estimator.joint.score import Joint, joint

__all__ = ["Joint", "joint"]

"""The joint between two moving bodies, from the tracks of markers on both: its centre, or the axis of a hinge.

The centre is at rest in both bodies: R_T_P u + c = R_T_C v + e at all times, T the axes of the tracks, P and C those of
parent and child. `ml` and `score` find (u, v); without a parent the room is it: the calibration of a probe's tip.
bodies → score or variances, noise, ml → axis → result; `find` is the way in. Uses geometry, adjustment and tracks.
"""

from baryscope.estimator.joint.find import joint
from baryscope.estimator.joint.result import HingeAxis, Joint, Method, Slide

__all__ = ["HingeAxis", "Joint", "Method", "Slide", "joint"]

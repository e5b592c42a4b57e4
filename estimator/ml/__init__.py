"""Maximum a posteriori estimate of path, points, rate and inertia of a free tumble, starting from `pivot`.

`method` is the entry and says why there is a prior; `likelihood` has the normal equations, also for the bound.
Uses pivot and the rooms that pivot uses.
"""

from baryscope.estimator.ml.likelihood import Equations, Model, equations
from baryscope.estimator.ml.method import estimate_by_likelihood

__all__ = ["Equations", "Model", "equations", "estimate_by_likelihood"]

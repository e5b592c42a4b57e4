"""Motion models: the path of the centre of mass and the free tumble of the body, each with its Jacobian.

Evaluates the CasADi expressions of `baryscope.models` and their derivatives numerically.
Uses geometry and options.
"""

from baryscope.estimator.dynamics.euler import INERTIA_BASIS
from baryscope.estimator.dynamics.paths import Path, Polynomial, SampledPath
from baryscope.estimator.dynamics.relative_motion import PerturbedOrbit, RelativeOrbit
from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA, Attitudes, Rotation, too_long
from baryscope.estimator.dynamics.trajectory import Trajectory, trajectory_of

__all__ = [
    "INERTIA_BASIS",
    "RATE_AND_INERTIA",
    "Attitudes",
    "Path",
    "PerturbedOrbit",
    "Polynomial",
    "RelativeOrbit",
    "Rotation",
    "SampledPath",
    "Trajectory",
    "too_long",
    "trajectory_of",
]

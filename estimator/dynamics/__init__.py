"""Motion models: the path of the centre of mass and the free tumble of the body, each with its Jacobian.

Evaluates the CasADi expressions of `baryscope.models` and their derivatives numerically.
Uses geometry and options.
"""

from baryscope.estimator.dynamics.paths import (
    Path,
    Polynomial,
    RelativeOrbit,
    SampledPath,
    Trajectory,
    trajectory_of,
)
from baryscope.estimator.dynamics.rotation import INERTIA_BASIS, RATE_AND_INERTIA, Attitudes, Rotation, too_long

__all__ = [
    "INERTIA_BASIS",
    "RATE_AND_INERTIA",
    "Attitudes",
    "Path",
    "Polynomial",
    "RelativeOrbit",
    "Rotation",
    "SampledPath",
    "Trajectory",
    "too_long",
    "trajectory_of",
]

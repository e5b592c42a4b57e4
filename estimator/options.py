"""What can be chosen for the screw methods; what is left None is chosen from the data."""

import math
from dataclasses import dataclass
from typing import Literal

from baryscope.estimator.fit import HIGHEST_DEGREE
from baryscope.estimator.procrustes import Reference
from baryscope.models.errors import InputError

Axes = Literal["inertial", "lvlh"]


@dataclass(frozen=True)
class ScrewOptions:
    """lag between the two poses of a screw in s; cutoff of the low-pass in Hz (math.inf: none); degree of the
    polynomial in time; axes in which the tracks are registered; reference of the Procrustes registration.

    Raises:
        InputError: a value that makes no sense.
    """

    lag: float | None = None
    cutoff: float | None = None
    degree: int | None = None
    axes: Axes = "inertial"
    reference: Reference = "mean"

    def __post_init__(self) -> None:
        if self.lag is not None and not (0 < self.lag < math.inf):
            raise InputError(f"lag is {self.lag}, expected a number of seconds > 0")
        if self.cutoff is not None and not self.cutoff > 0:
            raise InputError(f"cutoff is {self.cutoff}, expected a frequency in Hz > 0")
        if self.degree is not None and not 0 <= self.degree <= HIGHEST_DEGREE:
            raise InputError(f"degree is {self.degree}, expected 0 to {HIGHEST_DEGREE}")
        for name, value, known in (
            ("axes", self.axes, ("inertial", "lvlh")),
            ("reference", self.reference, ("mean", "first")),
        ):
            if value not in known:
                raise InputError(f"{name} is {value!r}, expected one of {', '.join(known)}")

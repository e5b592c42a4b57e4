"""Paths that add something to another one, and the factors that they estimate."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Factor:
    """An estimated factor of a force, or error of a camera: name, value, deviation and unit: 1, m/s², m or rad."""

    name: str
    value: float
    deviation: float
    unit: str


def named_factors(
    names: Sequence[str], units: Sequence[str], values: FloatArray, deviations: FloatArray
) -> tuple[Factor, ...]:
    """Factors (k,) of these names, units, values and deviations."""
    return tuple(map(Factor, names, values.tolist(), deviations.tolist(), units))


@dataclass(frozen=True, eq=False)
class ExtendedPath:
    """A path that adds something to another, `base`, whose name and gravity gradient it has.

    Its unknowns are those of the base, then its own, if it has any.
    """

    base: Path

    @property
    def name(self) -> str:
        """The model's name, that of the base."""
        return self.base.name

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.base.size

    @property
    def prior(self) -> Prior:
        """The prior of the unknowns."""
        return self.base.prior

    @property
    def frequency(self) -> float:
        """The frequency of the base; see `Path`."""
        return self.base.frequency

    def gravity_gradient(self, time: FloatArray) -> FloatArray | None:
        """See `Path`."""
        return self.base.gravity_gradient(time)

    def factors(self, x: FloatArray, of_x: FloatArray) -> tuple[Factor, ...]:
        """The factors among its own unknowns, from x (p,) and its covariance (p, p); none."""
        return ()


def parts_of(path: Path) -> Iterator[Path]:
    """The path, that which it is based on, and so on."""
    yield path
    while isinstance(path, ExtendedPath):
        path = path.base
        yield path


def based_on(path: Path, base: Path, part: Path | None = None) -> Path:
    """The path with all that is added to it, but with another one in the place of a part; of the last one unless given.

    part: one of `parts_of`.
    """
    if path is part or not isinstance(path, ExtendedPath):
        return base
    return replace(path, base=based_on(path.base, base, part))


def factors_of(path: Path, x: FloatArray, of_x: FloatArray) -> tuple[Factor, ...]:
    """The factors of all forces on a path, and the camera's errors, from its x (p,) and the covariance (p, p)."""
    parts = reversed([one for one in parts_of(path) if isinstance(one, ExtendedPath)])
    return tuple(factor for one in parts for factor in one.factors(x, of_x))

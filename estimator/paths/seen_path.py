"""A path as a camera with constant errors sees it: consider parameters (Schmidt 1966).

The errors are further unknowns with a prior. What is seen depends on them, the path does not: `SeenPath.at` has zero
columns for them, which makes every position, velocity and covariance that of the path itself. `as_seen` has the
columns of what is seen, which the adjustment fits to the tracks. So an error that the motion tells is estimated, and
one that it does not tell stands in the covariance.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.paths.extended_path import ExtendedPath, Factor, named_factors, parts_of
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.sampled_path import SampledPath

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SeenPath(ExtendedPath):
    """The unknowns of `base`, then the k constant errors of a camera, which do not move the path."""

    camera: SharedErrors

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.base.size + len(self.camera.deviations)

    @cached_property
    def prior(self) -> Prior:
        """The prior of the base, and that of the errors."""
        return self.base.prior.joined(Prior.known(self.camera.deviations**2))

    @property
    def errors(self) -> slice:
        """Where the errors are among the unknowns."""
        return slice(self.base.size, self.size)

    def factors(self, x: FloatArray, of_x: FloatArray) -> tuple[Factor, ...]:
        """The errors as estimated, from x and its covariance."""
        own = self.errors
        return named_factors(self.camera.names, self.camera.units, x[own], np.sqrt(np.diag(of_x)[own]))

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        return self.base.at(time).extended(self._still(time))

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity at times (n,) in s."""
        return self.base.rate_at(time).extended(self._still(time))

    def _still(self, time: FloatArray) -> FloatArray:
        """The derivatives (n, 3, k) of the path by the errors: none."""
        return np.zeros((len(time), 3, len(self.camera.deviations)))


def errors_in(path: Path) -> slice:
    """Where the constant errors of a camera are among a path's unknowns; empty if it has none."""
    return next((one.errors for one in parts_of(path) if isinstance(one, SeenPath)), slice(0, 0))


def as_seen(path: Path, own: SampledPath, errors: SharedErrors | None, x: FloatArray) -> SampledPath:
    """A path, sampled as `own`, as a camera with errors at the same times sees it, linear in them about x (p,)."""
    index = errors_in(path)
    if errors is None or index.start == index.stop:
        return own
    columns = errors.shifts(own.position(x))
    jacobian, turn = own.jacobian.copy(), np.zeros_like(own.jacobian)
    jacobian[:, :, index], turn[:, :, index] = columns, errors.turns()
    return SampledPath(jacobian, lambda changed: own.position(changed) + columns @ changed[index], own, turn)


def growth_in(path: Path, errors: SharedErrors | None, x: FloatArray) -> float:
    """What lengths within a body look like to a camera of the scale in unknowns x (p,), over the true ones: 1 + s."""
    index = errors_in(path)
    if errors is None or errors.scale is None or index.start == index.stop:
        return 1.0
    return 1.0 + float(x[index.start + errors.scale])


def of_true_size(offset: FloatArray, covariance: FloatArray, with_scale: FloatArray, variance: float) -> FloatArray:
    """The covariance (3, 3) of an offset d (3,) within a body, m, that a camera of a wrong scale s sees as (1 + s) d.

    covariance (3, 3): of the offset as seen; with_scale (3,): its covariance with s; variance: of s.
    """
    crossed = np.outer(with_scale, offset)
    return np.asarray(covariance - crossed - crossed.T + variance * np.outer(offset, offset))

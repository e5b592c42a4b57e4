"""What a posterior tells of a path's process noise, and the path's predictor."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.position_noise import Slip
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.hyperparameters.integration import Posterior
from baryscope.estimator.options import Density
from baryscope.estimator.paths.path import FIXED, Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.process_noise import DENSITY, noise_in
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.prediction import PredictedPath
from baryscope.estimator.result import ProcessNoise

FloatArray = NDArray[np.float64]


def process_noise_of(
    path: Path, sampled: SampledPath, x: FloatArray, prior: Prior, found: Posterior, asked: Density, slip: Slip
) -> ProcessNoise:
    """The process noise of a path with unknowns x (p,), sampled at the tracks' times.

    found: the posterior of the hyperparameters of the prior; asked: what the options ask for; slip: of a fixed path.
    """
    if path.name == FIXED:
        if not isinstance(asked, str):
            return ProcessNoise("given", slip.variance, of_position=True)
        if slip.interval is None:  # not looked for, as steps have not come to rest
            return ProcessNoise("none", 0.0, of_position=True)
        return ProcessNoise("estimated", slip.variance, slip.interval, slip.significance, of_position=True)
    noise = noise_in(path)
    if noise is None:
        return ProcessNoise("none", 0.0)
    displacement = _departure(path, sampled, x, slice(noise.base.size, noise.size))
    if noise.density is not None:
        return ProcessNoise("given", noise.density, displacement=displacement)
    index = prior.index(DENSITY)
    assert index is not None  # noqa: S101  the density is unknown
    density, significance = float(np.exp(found.theta[index])), float(max(found.significance[index], 0.0))
    return ProcessNoise("estimated", density, found.bounds(index), significance, displacement)


def _departure(path: Path, sampled: SampledPath, x: FloatArray, modes: slice) -> float:
    """The rms displacement by the modes, m, less what the unknowns without a prior could do as well."""
    gram, free = sampled.mean_square(), path.prior.free
    left = np.zeros_like(x)
    left[modes] = x[modes]
    left[free] = -symmetric_pseudo_inverse(gram[free][:, free]) @ (gram[free] @ left)
    return float(sampled.lengths(left[:, None])[0])


def predicted_path(
    path: Path, x: FloatArray, covariance: FloatArray, span: tuple[float, float], prior: Prior, found: Posterior
) -> PredictedPath:
    """The predictor of a path with unknowns x (p,) of covariance (p, p), for tracks over a span in s."""
    noise, index = noise_in(path), prior.index(DENSITY)
    if index is not None:
        density = float(found.expectation[index])
    else:
        density = 0.0 if noise is None or noise.density is None else noise.density
    return PredictedPath(path, x, covariance, *span, density)

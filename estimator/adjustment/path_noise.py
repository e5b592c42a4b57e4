"""What a posterior tells of a path's process noise, and the path's predictor."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.evidence import Posterior
from baryscope.estimator.dynamics.paths import Path, SampledPath
from baryscope.estimator.dynamics.prior import Prior
from baryscope.estimator.dynamics.process_noise import DENSITY
from baryscope.estimator.prediction import PredictedPath, noise_in
from baryscope.estimator.result import ProcessNoise

FloatArray = NDArray[np.float64]

NINETY = 1.645  # standard deviations either way that hold 90 %


def process_noise_of(path: Path, sampled: SampledPath, x: FloatArray, prior: Prior, found: Posterior) -> ProcessNoise:
    """The process noise of a path with unknowns x (p,), sampled at the tracks' times.

    found: the posterior of the hyperparameters of the prior.
    """
    noise = noise_in(path)
    if noise is None:
        return ProcessNoise("none", 0.0)
    modes = slice(noise.base.size, noise.size)
    displacement = float(np.sqrt(np.mean(np.sum((sampled.jacobian[:, :, modes] @ x[modes]) ** 2, axis=1))))
    if noise.density is not None:
        return ProcessNoise("given", noise.density, displacement=displacement)
    index = _index(prior)
    density = float(np.exp(found.theta[index]))
    centre, deviation = found.interval[index].mean(), np.ptp(found.interval[index]) / 2
    low, high = np.exp([centre - NINETY * deviation, centre + NINETY * deviation])
    return ProcessNoise(
        "estimated",
        density,
        (min(float(low), density), max(float(high), density)),
        float(max(found.significance[index], 0.0)),
        displacement,
    )


def predicted_path(
    path: Path, x: FloatArray, covariance: FloatArray, span: tuple[float, float], prior: Prior, found: Posterior
) -> PredictedPath:
    """The predictor of a path with unknowns x (p,) of covariance (p, p), for tracks over a span in s."""
    noise = noise_in(path)
    density = 0.0 if noise is None else noise.density
    if density is None:
        density = float(found.expectation[_index(prior)])
    return PredictedPath(path, x, covariance, *span, density)


def _index(prior: Prior) -> int:
    return [one.name for one in prior.hyperparameters].index(DENSITY)

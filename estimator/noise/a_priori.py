"""What is told of the noise, where the residuals contradict it: it is named, and not used where it is too small."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from baryscope.estimator.findings import MISFITS, WrongSigma
from baryscope.estimator.options import PathOptions
from baryscope.estimator.result import Estimate
from baryscope.models.errors import ComputationError

WRONG = 0.25  # relative error of a deviation that is named; outliers alone make up a tenth
CHANCE = 5.0  # standard deviations of its logarithm that are no chance
TURN = 6  # values of a frame that tell its place and attitude


def with_credible_sigma(fit: Callable[[PathOptions], Estimate], options: PathOptions) -> Estimate:
    """The estimate by a fit, without a sigma that its residuals exceed, or with which it does not come to rest.

    With such a sigma noise would pass for a motion of the path.

    Raises:
        ComputationError: the tracks do not determine the unknowns.
    """
    if options.sigma is None:
        return fit(options)
    try:
        told = fit(options)
    except ComputationError:
        told = None
    if told is not None:
        if told.noise.a_priori is None:
            return told  # the method makes no use of sigma
        wrong = _contradicted(told, options.sigma)
        if told.converged and not any(one.found > one.given for one in wrong):
            return replace(told, findings=told.findings + wrong)
    found = fit(replace(options, sigma=None))
    return replace(
        found,
        options=options,
        noise=replace(found.noise, a_priori=options.sigma),
        findings=found.findings + _contradicted(found, options.sigma),
        wall_time=found.wall_time + (0.0 if told is None else told.wall_time),
    )


def _contradicted(result: Estimate, sigma: float) -> tuple[WrongSigma, ...]:
    """The finding that the residuals are others than sigma tells, by more than chance and outliers explain.

    None where a model does not fit, as its residuals are not those of noise. A frame of n features has 3 n − 6 of its
    own; the logarithm of a deviation from k values has the deviation 1/√(2 k).
    """
    if any(isinstance(finding, MISFITS) for finding in result.findings):
        return ()
    features = (result.used & ~result.rejected).sum(axis=1)
    values = max(int(np.maximum(3 * features - TURN, 0).sum()), 1)
    found = result.noise.a_posteriori
    off = abs(float(np.log(max(found, 1e-300) / sigma)))
    return (WrongSigma(sigma, found),) if off > max(WRONG, CHANCE / np.sqrt(2 * values)) else ()

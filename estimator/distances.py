"""Whether features that are seen without an attitude contradict a path: how far each is from it does not change.

A point of a rigid body that turns about its centre of mass stays at its distance from that, however it turns. So each
feature tells by its distances of a path, without belonging to any body, and whatever place it has in one; an offset
that is wrong, but constant in the body, changes none of them. The median distance in the second half of the frames that
show a feature is compared with that in the first. Single outliers do not move a median; how likely more of them do
follows from how many there are.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc, chdtri

FloatArray = NDArray[np.float64]

FEWEST = 2  # observations of a feature: one in each half
MEDIAN_LOSS = np.pi / 2  # variance of a median of many normal values over that of their mean
CHANGED = float(chdtri(1, 1e-4))  # squared change over its variance, beyond which it is none by noise
BY_CHANCE = 1e-3  # probability of so many changes by outliers


def contradict(arm: FloatArray, variance: FloatArray, errors: FloatArray, outliers: float) -> bool:
    """Whether the distances of features from a path change by more than the path claims and noise allows.

    arm (k, m, 3): from the path to the features in k frames, m, NaN where one is not seen; variance (k, m): of an
    observation along it; errors (k, 3, q): what the path may be off by, for q independent errors of one standard
    deviation; outliers: the share of wrong observations elsewhere.
    """
    radius = np.linalg.norm(arm, axis=2)
    radial = np.einsum("kmi,kiq->kmq", arm / np.maximum(radius, np.finfo(float).tiny)[:, :, None], errors)
    by_outliers, changed = [], 0
    for feature in range(arm.shape[1]):
        seen = np.flatnonzero(np.isfinite(radius[:, feature]))
        if len(seen) < FEWEST:
            continue
        halves = np.split(seen, [len(seen) // 2])
        change = float(np.subtract(*(np.median(radius[half, feature]) for half in halves)))
        claimed = np.subtract(*(radial[half, feature].mean(axis=0) for half in halves))
        expected = float(claimed @ claimed)
        for half in halves:
            expected += MEDIAN_LOSS * float(variance[half, feature].mean()) / len(half)
        changed += int(change**2 > CHANGED * expected)
        # A median of n is as wrong as half of them are.
        wrong = sum(float(bdtrc((len(half) - 1) // 2, len(half), outliers)) for half in halves)
        by_outliers.append(min(wrong, 1.0))
    return changed > 0 and _at_least(changed, by_outliers) < BY_CHANCE


def _at_least(count: int, probabilities: list[float]) -> float:
    """The probability that so many or more of independent events of these probabilities happen."""
    of_count = np.ones(1)
    for one in probabilities:
        of_count = np.convolve(of_count, [1 - one, one])
    return float(of_count[count:].sum())

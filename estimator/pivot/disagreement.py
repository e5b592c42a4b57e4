"""Clusters that disagree by free attitudes, and by those of a tumble, too.

Poor attitudes may be what two clusters disagree by, and a tumble has better ones. But a panel that has bent between
them is no matter of attitudes.
"""

import numpy as np
from scipy.special import chdtrc

from baryscope.estimator.adjustment.diagnostics import information_in_body
from baryscope.estimator.findings import DisagreeingClusters
from baryscope.estimator.geometry.symmetric import symmetric_inverses
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks

SIGNIFICANCE = 1e-6  # probability that the same features seem to have moved between two clusters


def disagreeing_by_tumble(
    solved: PivotSolution, found: Estimate, tracks: FeatureTracks
) -> tuple[DisagreeingClusters, ...]:
    """The findings of a solution with free attitudes that hold by those of an estimate of the same tracks in C, too."""
    known = (one for one in solved.findings if isinstance(one, DisagreeingClusters))
    return tuple(one for one in known if _disagree(one, solved, found, tracks))


def _disagree(finding: DisagreeingClusters, solved: PivotSolution, found: Estimate, tracks: FeatureTracks) -> bool:
    """Whether features that two clusters see have other mean residuals in axes of the body in the one than in the
    other, beyond noise.
    """
    columns = np.array([found.labels.index(label) for label in finding.labels if label in found.labels])
    if found.attitude is None or not columns.size:
        return False
    means, variances = [], []
    for body in (solved.bodies[index] for index in finding.clusters):
        at, turn = np.ix_(body.frames, columns), found.attitude[body.frames]
        shown = (found.used & ~found.rejected)[at] & np.isfinite(found.residuals[at][..., 0])
        residual = np.where(shown[..., None], found.residuals[at], 0.0) @ turn
        sources = np.ix_(body.frames, found.sources(tracks.labels)[columns])
        own = None if tracks.covariance is None else tracks.covariance[sources]
        information = information_in_body(shown, own, turn)
        covariance = symmetric_inverses(information.sum(axis=0))
        means.append(np.einsum("mij,kmjl,kml->mi", covariance, information, residual))
        variances.append(found.noise.lasting * found.noise.a_posteriori**2 * covariance)
    apart = means[0] - means[1]
    squares = np.einsum("mi,mij,mj->", apart, symmetric_inverses(variances[0] + variances[1]), apart)
    return bool(chdtrc(3 * len(columns), squares) < SIGNIFICANCE)

"""What speaks against a solution: labels, excess residuals, lack of fit of the path's model, too few frames."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc

from baryscope.estimator.adjustment.degrees_of_freedom import least_variance, values_for_path
from baryscope.estimator.adjustment.frame_shifts import shifts_in
from baryscope.estimator.adjustment.subsample import subsampled
from baryscope.estimator.findings import (
    DifferentPoints,
    DisagreeingClusters,
    ExcessResiduals,
    FewFrames,
    Finding,
    LackOfFit,
)
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.process_noise import DENSITY
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.paths.trajectory import smooth_in
from baryscope.estimator.pivot.free_attitudes import gauss_newton_step
from baryscope.estimator.pivot.joint_covariance import JointCovariance, without_spurious_information
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.refinement import ROUNDING
from baryscope.estimator.pivot.tie_points import TiePoints
from baryscope.estimator.registration.clusters import Registered
from baryscope.estimator.tracks import FeatureTracks

FloatArray = NDArray[np.float64]

TELLING = 15.0  # frames, from which they tell how great process noise is
MAX_VARIANCE_RATIO = 1.5  # variance of the residuals over that of the registration, above which the path does not fit
EXCESSIVE = 1e-5  # probability of that ratio by chance, below which it is named
RADII = 3.0  # of the features, deviation of a position that slips, above which it is no pivot's
MIN_NEW_SHARE = 0.01  # share of a cubic that the path model cannot represent, from which it is tested
SIGNIFICANCE = 1e-7  # probability of a lack of fit by chance
TEST_FRAMES = 1500  # frames used in the test, at most
MAX_SPURIOUS_GROWTH = 1.5  # of an offset's variance by removal of spurious information, for the test to be valid


def misfits(found: PivotSolution, registered: Registered, tracks: FeatureTracks) -> tuple[Finding, ...]:
    """Findings against labels and path."""
    findings: list[Finding] = [_of_refused(points, tracks.labels) for points in found.refused]
    measured = found.observations
    if found.residual_variance > least_variance(measured, ROUNDING):
        excess = excess_residuals(found, registered) if measured.precision is None else None
        excess = excess or _excessive_slip(found)
        if excess is not None:
            findings.append(excess)
        elif found.path.prior.free.all() and (finding := lack_of_fit(found, tracks.time)):
            findings.append(finding)
    frames, unknowns = sum(len(body.frames) for body in found.bodies), found.path_unknowns + 3 * len(found.bodies)
    told = frames / found.lasting
    # Of the unknowns of a smooth path, or of process noise, the law tells some, and the covariance has its misfit.
    by_law = smooth_in(found.path) is not None or (found.has(DENSITY) and told >= TELLING)
    if (2 * told if by_law else told) < unknowns:
        findings.append(FewFrames(frames, unknowns, found.lasting))
    return tuple(findings)


def _of_refused(points: TiePoints, labels: tuple[str, ...]) -> DifferentPoints | DisagreeingClusters:
    """The finding of tie points that are refused."""
    names = tuple(labels[index] for index in points.features)
    if points.disagreement is None:
        return DifferentPoints(names, points.bodies)
    return DisagreeingClusters(names, points.bodies, points.disagreement)


def excess_residuals(found: PivotSolution, registered: Registered) -> ExcessResiduals | None:
    """A finding if the variance of the residuals is above that of the registration, by more than chance.

    The registration's are some of the values of the solution: of independent ones the ratio would scatter more.
    """
    ratio = found.residual_variance / max(registered.noise**2, 1e-300)
    dof = values_for_path(found.bodies, found.observations) - found.path_unknowns
    chance = fdtrc(max(dof, 0.0) / found.lasting, registered.values / found.lasting, ratio)
    if ratio <= MAX_VARIANCE_RATIO or chance >= EXCESSIVE:
        return None
    return ExcessResiduals(found.path.name, float(np.sqrt(ratio)))


def slips_excessively(found: PivotSolution) -> bool:
    """Whether the position slips so far that it is no pivot: further than features are from one another."""
    body = max(found.bodies, key=lambda one: len(one.frames))
    return found.slip.deviation > RADII * rms_radius(body.points)


def _excessive_slip(found: PivotSolution) -> ExcessResiduals | None:
    """A finding if the position slips excessively."""
    if not slips_excessively(found):
        return None
    return ExcessResiduals(found.path.name, float(np.hypot(found.slip.deviation, found.noise) / found.noise))


def lack_of_fit(found: PivotSolution, time: FloatArray) -> LackOfFit | None:
    """A finding if a cubic in time, added to the path model, improves the fit by more than noise explains.

    Only the part of the cubic that the path model cannot represent is added, with k unknowns. If the model is right,
    the decrease of the cost is χ² distributed with k degrees of freedom. This does not hold if a direction is poorly
    observed, so there is no finding then.
    """
    subsample = subsampled(found.bodies, found.observations, TEST_FRAMES)
    few, rows, x = subsample.observations, subsample.rows, found.solution.x
    own = found.sampled.jacobian[rows]
    cubic = Polynomial(3, float(time[0]), float(time[-1])).at(time[rows]).jacobian
    known, added = own.reshape(3 * len(rows), -1), cubic.reshape(3 * len(rows), -1)
    added = added - known @ (symmetric_pseudo_inverse(known.T @ known) @ (known.T @ added))
    squares, axes = np.linalg.eigh(added.T @ added)
    size = np.linalg.norm(cubic, axis=(0, 1)).max()
    new = added @ axes[:, squares > (MIN_NEW_SHARE * size) ** 2] / size
    if not new.shape[1]:
        return None
    position, new = found.sampled.position(x)[rows], np.sqrt(len(rows)) * new.reshape(len(rows), 3, -1)
    extended = SampledPath(np.concatenate([own, new], axis=2), lambda y: position + new @ y[len(x) :])
    start = np.concatenate([x, np.zeros(new.shape[2])])
    shifts = shifts_in(found.shifts, rows)
    with_cubic, without = (
        gauss_newton_step(subsample.bodies, few, extended, start, shifts),
        gauss_newton_step(subsample.bodies, few, SampledPath(own, lambda _: position), x, shifts),
    )
    gain = (with_cubic.decrease - without.decrease) / found.variance
    if chdtrc(new.shape[2], max(gain, 0.0)) > SIGNIFICANCE or _is_poorly_observed(found):
        return None
    metres = float(extended.lengths((with_cubic.x - start)[:, None])[0])
    return LackOfFit(found.path.name, metres, float(gain), int(new.shape[2]))


def _is_poorly_observed(found: PivotSolution) -> bool:
    """Whether spurious information is a large part of the information on some body's offset."""
    after = without_spurious_information(found).of_offsets
    before = JointCovariance(found.variance * found.solution.offset_covariance, len(found.bodies)).of_offsets
    growth = np.trace(after, axis1=1, axis2=2), MAX_SPURIOUS_GROWTH * np.trace(before, axis1=1, axis2=2)
    return bool(np.any(growth[0] > growth[1]))

"""The derived values of an estimate, from constructed covariances, residuals and weights."""

import numpy as np
import pytest

from baryscope.estimator.findings import (
    ChangingNoise,
    ContradictedPath,
    DepthNoise,
    DifferentPoints,
    DisagreeingClusters,
    ExcessResiduals,
    Extrapolated,
    FewFrames,
    FollowsRotation,
    LackOfFit,
    MovingFeatures,
    OtherBody,
    UnknownPush,
    UntoldAccuracy,
    WrongSigma,
)
from baryscope.estimator.methods import estimate
from baryscope.estimator.observability import PrincipalAxes
from baryscope.estimator.result import Status
from results import a_cluster, an_estimate


def test_principal_axes_are_those_of_the_covariance():
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    found = PrincipalAxes.of(axes @ np.diag([9.0, 1.0, 4.0]) @ axes.T)
    np.testing.assert_allclose(found.deviations, [1, 2, 3], rtol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(found.directions * axes.T[[1, 2, 0]], axis=1)), 1, rtol=1e-12)


def test_observability_counts_the_cluster_of_most_frames_and_a_quarter_of_its_radius():
    few, many = a_cluster([1.0, 1.0, 1.0], frames=3), a_cluster([0.01, 0.24, 0.26], frames=6)
    found = an_estimate(clusters=(few, many)).observability
    assert found.cluster == 1
    assert found.threshold == pytest.approx(0.25)
    assert found.observable.tolist() == [True, True, False]
    assert found.condition_number == pytest.approx(26**2)
    np.testing.assert_allclose(found.inertial.deviations, [0.01, 0.02, 0.03])


def test_coverage_is_the_share_of_frames_with_an_attitude():
    clusters = (a_cluster([1.0, 1.0, 1.0], frames=3), a_cluster([0.01, 0.02, 0.03], frames=6))
    assert an_estimate(clusters=clusters).coverage == pytest.approx(0.6)


def test_status_is_the_most_severe_defect():
    hidden = (a_cluster([0.01, 0.02, 4.0]),)
    misfits = (
        LackOfFit("fixed", 0.1, 90.0, 3),
        ExcessResiduals("free tumble", 2.0),
        DisagreeingClusters(("a",), (0, 1), 4.0),
    )
    assert an_estimate().status is Status.GOOD
    noises = (WrongSigma(0.01, 0.02), ChangingNoise((0.0, 3.0), (0.01, 0.03)), DepthNoise(0.01, 0.05, 2.5))
    for remark in (
        DifferentPoints(("a",), (0, 1)),
        UntoldAccuracy(1e4, 0.0),
        UnknownPush("sun", (1e-7,), (1e-9,)),
        MovingFeatures(("a",)),
        FollowsRotation(0.9, 30.0),
        Extrapolated(2.0, 3.0),
        *noises,
    ):
        assert an_estimate(findings=(remark,)).status is Status.GOOD
    assert an_estimate(clusters=hidden).status is Status.NOT_OBSERVABLE
    for misfit in misfits:
        assert an_estimate(clusters=hidden, findings=(misfit,)).status is Status.MODEL_DOES_NOT_FIT
        assert an_estimate(findings=(FewFrames(7, 9.2), misfit)).status is Status.MODEL_DOES_NOT_FIT
    for unchecked in (FewFrames(7, 9.2), ContradictedPath(2.0, 3.0), OtherBody(("a",))):
        assert an_estimate(clusters=hidden, findings=(unchecked,)).status is Status.NOT_CHECKED
    assert an_estimate(converged=False, findings=misfits).status is Status.NOT_CONVERGED
    assert [status.value for status in Status if status.trustworthy] == ["good", "not observable"]


def test_an_estimate_is_shown_by_its_status_and_claim():
    """Whoever looked at one in a notebook was shown all of its numbers, and its status, a property, not at all."""
    assert repr(an_estimate()).startswith("<Estimate by ")
    assert ": good; " in repr(an_estimate())
    assert "claimed to ±37.42 mm rms" in repr(an_estimate())  # √14e-4 m
    doubtful = repr(an_estimate(findings=(FewFrames(7, 9.2), WrongSigma(0.01, 0.02))))
    assert ": not checked; " in doubtful
    assert doubtful.endswith("findings: FewFrames, WrongSigma>")
    assert "no covariance, so no claim" in repr(an_estimate(covariance=None))
    assert "\n" not in doubtful


def test_predicted_rmse_is_the_mean_trace():
    assert an_estimate().predicted_rmse == pytest.approx(np.sqrt(14e-4))
    assert an_estimate(covariance=None).predicted_rmse is None


def test_residuals_by_feature_leave_out_rejected_and_missing_observations():
    residuals, rejected = np.zeros((10, 4, 3)), np.zeros((10, 4), dtype=bool)
    residuals[:, 0], residuals[:5, 1] = [0.03, 0.0, 0.0], 0.02
    residuals[5:, 1] = np.nan
    residuals[:, 2], rejected[:, 2] = 5.0, True
    found = an_estimate(residuals=residuals, rejected=rejected).feature_rms
    np.testing.assert_allclose(found, [0.03 / np.sqrt(3), 0.02, np.nan, 0.0])


def test_rejected_share_and_features():
    used, rejected = np.ones((10, 4), dtype=bool), np.zeros((10, 4), dtype=bool)
    rejected[2:5, 0] = rejected[7, 0] = rejected[:6, 1] = True
    used[5:, 3] = False
    found = an_estimate(used=used, rejected=rejected)
    assert found.rejected_features == ("b",)
    assert found.rejected_share == pytest.approx(10 / 35)


def test_the_centre_of_mass_in_the_axes_of_each_cluster(case_of, at_rest):
    """Against the truth: the shape's axes are those of C in the interval's first frame, its origin the centroid."""
    case = case_of(at_rest)
    found = estimate(case.tracks, method="screw-gpa")
    for cluster in found.clusters:
        k = cluster.frames[0]
        members = case.features[[case.tracks.labels.index(name) for name in cluster.labels]]
        np.testing.assert_allclose(cluster.centre_of_mass, -case.R_I_B[k] @ members.mean(axis=0), atol=1e-6)
        np.testing.assert_allclose(cluster.points, (members - members.mean(axis=0)) @ case.R_I_B[k].T, atol=1e-6)

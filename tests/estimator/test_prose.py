import numpy as np
import pytest

from baryscope.estimator.findings import (
    ChangingNoise,
    ContradictedPath,
    Departure,
    DepthNoise,
    DifferentPoints,
    DisagreeingClusters,
    EstimatedOrbit,
    ExcessResiduals,
    Extrapolated,
    FewFrames,
    FollowsRotation,
    FramesLeftOut,
    FreeAttitudes,
    HeldFrames,
    LackOfFit,
    MovingFeatures,
    OtherBody,
    UnknownPush,
    UntoldAccuracy,
    WrongSigma,
)
from baryscope.estimator.methods import estimate
from baryscope.estimator.prose import sentence, summary, verdict
from baryscope.estimator.result import Noise, ProcessNoise
from results import a_cluster, an_estimate


def verdict_of(deviations, axes=None):
    return verdict(an_estimate(clusters=(a_cluster(deviations, axes=axes),)).observability)


@pytest.mark.parametrize(
    "deviations, expected",
    [
        ([0.001, 0.002, 0.0123], "observable: ±0.012 m in the worst direction"),
        ([0.24, 0.24, 0.24], "observable: ±0.24 m in the worst direction"),
        ([0.001, 0.002, 0.26], "along-axis position not observable: ±0.26 m along (0.00, 0.00, 1.00) (cluster axes)"),
        ([0.001, 0.002, 4.0], "along-axis position not observable: ±4 m along (0.00, 0.00, 1.00) (cluster axes)"),
        ([0.001, 3.0, 4.0], "position across (1.00, 0.00, 0.00) not observable: ±4 m"),
        ([2.0, 3.0, 40.0], "position not observable: ±40 m"),
        ([0.0, 0.0, 0.0], "observable: ±0 m in the worst direction"),
    ],
)
def test_verdict(deviations, expected):
    """A quarter of the features' radius, 1 m, is the limit."""
    assert verdict_of(deviations).replace("-0.00", "0.00").replace("-1.00", "1.00") == expected


def test_verdict_names_a_skew_axis():
    axis = np.array([0.0, 0.6, 0.8])
    axes = np.column_stack([axis, [1, 0, 0], np.cross(axis, [1, 0, 0])])
    assert "along (0.00, 0.60, 0.80)" in verdict_of([2.0, 0.01, 0.01], axes).replace("-", "")


@pytest.mark.parametrize(
    "finding, expected",
    [
        (LackOfFit("fixed", 0.123, 91.4, 3), "the path departs from fixed by 0.12 m or so (χ² 91, expected 3)"),
        (
            ExcessResiduals("free tumble", 2.04),
            "no free tumble fits: residuals are 2.04 times those with free attitudes",
        ),
        (ExcessResiduals("fixed", 3.3), "fixed does not fit: residuals are 3.3 times those of the bodies alone"),
        (
            Departure("relative-orbit", 0.0152, 3e-9, 90.0),
            "the path departs from relative-orbit by 0.015 m rms, as white acceleration of 3e-09 m²/s³ would make it: "
            "the covariance allows for that, not for a camera's attitude that drifts",
        ),
        (
            EstimatedOrbit(5904.21, 11.4, 0.01831, 0.00412),
            "no orbit is given, but the path tells one, on which it lies: a period of 98.40 ± 0.19 min and an "
            "eccentricity of 0.0183 ± 0.0041",
        ),
        (
            FewFrames(7, 9.2),
            "7 frames show an attitude, for 9 unknowns of the motion: no outlier or misfit would be seen",
        ),
        (
            FewFrames(1073, 23.9, 96.27),
            "1073 frames show an attitude, of which 96.3 have the same errors, for 24 unknowns of the motion: no "
            "outlier or misfit would be seen",
        ),
        (
            FollowsRotation(0.934, 22.7),
            "the path, of 23 unknowns, may follow the rotation, with a centre of mass that is wrong by as much: of "
            "what the tracks tell of it, noise of the attitudes feigns 93 %; the claim allows for that; the method ml "
            "has less freedom",
        ),
        (
            Extrapolated(26.14, 40.7),
            "attitudes are seen from 26.1 to 40.7 s only: beyond, the path is extrapolated, which nothing checks "
            "without an orbit that has all forces: the claim there is up to twice as wide",
        ),
        (
            ContradictedPath(26.14, 40.7),
            "attitudes are seen from 26.1 to 40.7 s only: beyond, the path is extrapolated, and features that are seen "
            "there contradict it",
        ),
        (
            FramesLeftOut(3.0, 15.5, 13, 0.456),
            "nothing fits from 3.0 to 15.5 s: all 13 frames there are left out, off by 0.46 m",
        ),
        (WrongSigma(0.01, 0.0204), "sigma is 0.01, but the residuals show 0.0204: claims are made of that"),
        (WrongSigma(0.02, 0.0104), "sigma is 0.02, but the residuals show 0.0104: claims may be too wide"),
        (
            ChangingNoise((0.0, 9.62), (0.0003, 0.00312)),
            "the noise changes: 0.0003 m at first, 0.0031 m from 9.6 s on; every frame is weighed by its own",
        ),
        (
            UnknownPush("lvlh", (1.234e-8, -2.346e-6, 0.0), (2e-9, 3e-9, 1e-9)),
            "something pushes the target against the chaser, by (1.23e-08 ± 2e-09, -2.35e-06 ± 3e-09, 0 ± 1e-09) m/s² "
            "in LVLH on average, which nothing told, or the orbit or the camera's place is not as told; the estimate "
            "has it, and allows for its variation along the orbit",
        ),
        (
            UnknownPush("sun", (2e-7,), (3e-9,)),
            "something pushes the target against the chaser, by (2e-07 ± 3e-09) m/s² away from the Sun on average, "
            "which nothing told; the estimate has it, and allows for its variation along the orbit",
        ),
        (
            UntoldAccuracy(24.4e3, 1e-7),
            "the tracks do not exclude an orbit that is off by 24 km and a push of 1e-07 m/s², for which the estimate "
            "allows: put the accuracy of the orbit into its file, in m, 0 if it is exact and nothing pushes",
        ),
        (
            UntoldAccuracy(0.0, 1e-7),
            "the tracks do not exclude a push of 1e-07 m/s², for which the estimate allows: put the accuracy of the "
            "orbit into its file, in m, 0 if it is exact and nothing pushes",
        ),
        (
            DepthNoise(0.00127, 0.0071),
            "depths have a noise of 0.0071 m, places across the line of sight one of 0.0013 m, which nothing told; "
            "every observation is weighed by that",
        ),
        (
            DepthNoise(0.00127, 0.0071, 2.5),
            "depths have a noise of 0.0071 m, places across the line of sight one of 0.0013 m, which covariances with "
            "a ratio of 2.5, not 5.6, told; every observation is weighed by that",
        ),
        (
            HeldFrames(3.0, 9.5, 1),
            "1 frame repeats the one before in every digit, from 3.0 to 9.5 s, as of a tracker that lost the body: "
            "left out",
        ),
        (MovingFeatures(("a",)), "a moves on the body, as on a panel that bends: left out"),
        (MovingFeatures(("a", "b")), "a, b move on the body, as on a panel that bends: left out"),
        (
            FreeAttitudes("the steps to a tumble do not converge"),
            "the steps to a tumble do not converge: this is the estimate with free attitudes, as of pivot",
        ),
        (DifferentPoints(("a",), (0, 2)), "a: not the same in clusters 0 and 2, no tie point"),
        (DifferentPoints(("a", "b"), (0, 2)), "a, b: not the same in clusters 0 and 2, no tie points"),
        (
            OtherBody(("a", "b", "c")),
            "a, b, c are rigid among themselves, but move against the features of the estimate: another body, which is "
            "left out; if it is the one that is meant, leave out the others",
        ),
        (
            DisagreeingClusters(("a", "b"), (0, 2), 3.14),
            "clusters 0 and 2 see a, b 3.1 times as far apart as they claim to know: "
            "the path between them does not fit, or attitudes are spoilt",
        ),
    ],
)
def test_sentences(finding, expected):
    assert sentence(finding) == expected


def test_summary_has_noise_rejected_features_and_every_finding():
    rejected = np.zeros((10, 4), dtype=bool)
    rejected[:6, 1] = True
    found = an_estimate(rejected=rejected, converged=False, findings=(DifferentPoints(("a",), (0, 1)),))
    assert summary(found) == [
        "trajectory fixed; noise 0.02 m per axis; 15 % of the observations rejected, features b",
        "centre of mass observable: ±0.03 m in the worst direction; path ±0.037 m RMSE",
        "did not converge: the result is a rough approximation only",
        "note: a: not the same in clusters 0 and 1, no tie point",
    ]
    unchecked = an_estimate(findings=(ContradictedPath(2.0, 3.0),))
    assert summary(unchecked)[2] == "not checked: not to be trusted, for what is noted here"
    factor = an_estimate(noise=Noise(None, 1.2, relative=True))
    assert "noise √1.44 times that of the tracks' covariances" in summary(factor)[0]
    slow = an_estimate(noise=Noise(None, 0.02, lasting=12.34))
    assert "noise 0.02 m per axis, the same in 12.3 frames;" in summary(slow)[0]


def test_summary_of_a_screw_method_has_the_options_chosen_from_data(case_of, at_rest):
    first, second, third = summary(estimate(case_of(at_rest, noise=0.02).tracks, method="screw-gpa"))
    assert first.endswith("(chosen from the data: lag, cutoff, degree)")
    assert second.startswith("rms of the registration 0.02 m, ")
    assert third == "no covariance; screw-gpa does not test its models: where they are wrong, nothing here says so"


@pytest.mark.parametrize(
    "noise, expected",
    [
        (ProcessNoise("given", 1e-8, None, None, 0.02), "process noise 1e-08 m²/s³ as given, 0.02 m rms of the path"),
        (
            ProcessNoise("estimated", 2e-9, (1e-9, 4e-9), 30.0, 0.0123),
            "process noise 2e-09 m²/s³ (1e-09 to 4e-09), 0.012 m rms of the path",
        ),
        (ProcessNoise("estimated", 2e-15, (1e-16, 3e-13), 0.1, 1e-7), "process noise not seen: below 3e-13 m²/s³"),
        (ProcessNoise("estimated", 2e-5, (1e-5, 3e-5), of_position=True), "process noise 2e-05 m² (1e-05 to 3e-05)"),
    ],
)
def test_process_noise_in_a_line(noise, expected):
    assert expected in summary(an_estimate(process_noise=noise))


def test_no_line_without_process_noise():
    assert not any("process noise" in line for line in summary(an_estimate(process_noise=ProcessNoise("none", 0.0))))

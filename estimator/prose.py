"""An estimate in sentences: the texts of a result's verdict, findings and summary."""

import math

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.details import ScrewDetails
from baryscope.estimator.findings import (
    FREE_TUMBLE,
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
    Finding,
    FollowsRotation,
    FramesLeftOut,
    FreeAttitudes,
    HeldFrames,
    LackOfFit,
    MovingFeatures,
    OtherBody,
    UnknownBurn,
    UnknownPush,
    UntoldAccuracy,
    UntoldOblateness,
    WrongOrbit,
    WrongSigma,
)
from baryscope.estimator.observability import Observability
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.paths.extended_path import Factor
from baryscope.estimator.paths.forces import VARIES
from baryscope.estimator.result import Estimate, ProcessNoise, Status
from baryscope.models.words import counted

AXES = {"lvlh": "LVLH", "inertial": "inertial axes"}
HIDDEN = ("error of the firing", "orbit ", VARIES)  # factors that a summary leaves out


def verdict(observability: Observability) -> str:
    """Whether the centre of mass is observable in the cluster's axes, with the worst deviation."""
    worst = f"±{observability.body.deviations[-1]:.2g} m"
    unseen = ~observability.observable
    if not unseen.any():
        return f"observable: {worst} in the worst direction"
    if unseen.all():
        return f"position not observable: {worst}"
    if unseen.sum() == 2:
        return f"position across {_vector(observability.body.directions[0])} not observable: {worst}"
    axis = _vector(observability.body.directions[-1])
    return f"along-axis position not observable: {worst} along {axis} (cluster axes)"


def sentence(finding: Finding) -> str:
    """A finding in words."""
    match finding:
        case (
            LackOfFit() | ExcessResiduals() | FramesLeftOut() | Departure() | DisagreeingClusters() | DifferentPoints()
        ):
            return _of_misfit(finding)
        case FewFrames() | FollowsRotation() | Extrapolated() | ContradictedPath() | OtherBody():
            return _of_doubt(finding)
        case WrongOrbit() | EstimatedOrbit() | UntoldOblateness() | UntoldAccuracy():
            return _of_orbit(finding)
        case UnknownBurn() | UnknownPush():
            return _of_force(finding)
        case WrongSigma() | ChangingNoise() | DepthNoise() | MovingFeatures() | HeldFrames():
            return _of_noise(finding)
        case FreeAttitudes():
            return f"{finding.reason}: this is the estimate with free attitudes, as of pivot"


def _of_misfit(
    finding: LackOfFit | ExcessResiduals | FramesLeftOut | Departure | DisagreeingClusters | DifferentPoints,
) -> str:
    """A model that does not hold, in words."""
    match finding:
        case LackOfFit():
            return (
                f"the path departs from {finding.path} by {finding.magnitude:.2g} m or so "
                f"(χ² {finding.chi_square:.0f}, expected {finding.dof})"
            )
        case ExcessResiduals(model=model) if model == FREE_TUMBLE:
            return f"no free tumble fits: residuals are {finding.ratio:.3g} times those with free attitudes"
        case ExcessResiduals():
            return f"{finding.model} does not fit: residuals are {finding.ratio:.2g} times those of the bodies alone"
        case FramesLeftOut():
            return (
                f"nothing fits from {finding.begin:.1f} to {finding.end:.1f} s: all {finding.frames} frames there are "
                f"left out, off by {finding.magnitude:.2g} m"
            )
        case Departure():
            return (
                f"the path departs from {finding.path} by {finding.magnitude:.2g} m rms, as white acceleration of "
                f"{finding.density:.2g} m²/s³ would make it: the covariance allows for "
                "that, not for a camera's attitude that drifts"
            )
        case DisagreeingClusters():
            first, second = finding.clusters
            return (
                f"clusters {first} and {second} see {', '.join(finding.labels)} {finding.ratio:.2g} times as far apart "
                "as they claim to know: the path between them does not fit, or attitudes are spoilt"
            )
        case DifferentPoints():
            first, second = finding.clusters
            names, no_ties = ", ".join(finding.labels), "no tie point" if len(finding.labels) == 1 else "no tie points"
            return f"{names}: not the same in clusters {first} and {second}, {no_ties}"


def _of_doubt(finding: FewFrames | FollowsRotation | Extrapolated | ContradictedPath | OtherBody) -> str:
    """What the tracks cannot check, in words."""
    match finding:
        case FewFrames():
            alike = f", of which {finding.lasting:.3g} have the same errors," if finding.lasting > 1 else ","
            return (
                f"{counted(finding.frames, 'frame shows', 'frames show')} an attitude{alike} for "
                f"{finding.unknowns:.0f} unknowns of the motion: no outlier or misfit would be seen"
            )
        case FollowsRotation():
            return (
                f"the path, of {finding.unknowns:.0f} unknowns, may follow the rotation, with a centre of mass that is "
                "wrong by as much: of what the tracks tell of it, noise of the attitudes feigns "
                f"{100 * min(finding.share, 1.0):.0f} %; the claim allows for that; the method ml has less freedom"
            )
        case OtherBody():
            return (
                f"{', '.join(finding.labels)} are rigid among themselves, but move against the features of the "
                "estimate: another body, which is left out; if it is the one that is meant, leave out the others"
            )
        case Extrapolated() | ContradictedPath():
            what = (
                "which nothing checks without an orbit that has all forces: the claim there is up to twice as wide"
                if isinstance(finding, Extrapolated)
                else "and features that are seen there contradict it"
            )
            return (
                f"attitudes are seen from {finding.begin:.1f} to {finding.end:.1f} s only: beyond, the path is "
                f"extrapolated, {what}"
            )


def _of_orbit(finding: WrongOrbit | EstimatedOrbit | UntoldOblateness | UntoldAccuracy) -> str:
    """What is found of the target's orbit, in words."""
    match finding:
        case WrongOrbit():
            parts = zip(("radially", "along", "across"), finding.shift, finding.deviation, strict=True)
            off = ", ".join(f"{value / 1e3:.3g} ± {sd / 1e3:.2g} km {where}" for where, value, sd in parts)
            other = "" if finding.oblate else ", or this is J2, which the orbit file does not tell"
            return f"the target is off its orbit by {off}, for which the estimate is corrected{other}"
        case EstimatedOrbit():
            return (
                "no orbit is given, but the path tells one, on which it lies: a period of "
                f"{_to_its_digits(finding.period / 60, finding.period_deviation / 60)} min and an eccentricity of "
                f"{_to_its_digits(finding.eccentricity, finding.eccentricity_deviation)}"
            )
        case UntoldOblateness():
            shown = (
                "but the tracks are likelier with the Earth's about the axis z, which the estimate has"
                if finding.certain
                else "the tracks do not tell the Earth's about the axis z from none, and the estimate allows for either"
            )
            return (
                f"no orbit file tells J2, {shown}: put j2 and equatorial_radius into the file, j2 = 0 if there is none"
            )
        case UntoldAccuracy():
            sizes = [f"an orbit that is off by {finding.place / 1e3:.2g} km"] if finding.place else []
            sizes += [f"a push of {finding.push:.2g} m/s²"] if finding.push else []
            return (
                f"the tracks do not exclude {' and '.join(sizes)}, for which the estimate allows: put the accuracy of "
                "the orbit into its file, in m, 0 if it is exact and nothing pushes"
            )


def _of_force(finding: UnknownBurn | UnknownPush) -> str:
    """A force that nobody told, in words."""
    match finding:
        case UnknownBurn():
            change = ", ".join(
                f"{1e3 * value:.3g} ± {1e3 * sd:.2g}"
                for value, sd in zip(finding.change, finding.change_deviation, strict=True)
            )
            return (
                f"the chaser burned from {finding.begin:.1f} ± {finding.begin_deviation:.1f} to {finding.end:.1f} ± "
                f"{finding.end_deviation:.1f} s and changed its velocity by ({change}) mm/s in "
                f"{AXES[finding.axes]}, which nothing told; the estimate allows for it"
            )
        case UnknownPush():
            pairs = zip(finding.acceleration, finding.acceleration_deviation, strict=True)
            push = ", ".join(f"{value:.3g} ± {sd:.2g}" for value, sd in pairs)
            where = "away from the Sun" if finding.axes == "sun" else f"in {AXES[finding.axes]}"
            alike = "" if finding.axes == "sun" else ", or the orbit or the camera's place is not as told"
            return (
                f"something pushes the target against the chaser, by ({push}) m/s² {where} on average, which nothing "
                f"told{alike}; the estimate has it, and allows for its variation along the orbit"
            )


def _of_noise(finding: WrongSigma | ChangingNoise | DepthNoise | MovingFeatures | HeldFrames) -> str:
    """What is found of the noise, in words."""
    match finding:
        case WrongSigma():
            return f"sigma is {finding.given:.3g}, but the residuals show {finding.found:.3g}: " + (
                "claims are made of that" if finding.found > finding.given else "claims may be too wide"
            )
        case ChangingNoise():
            later = zip(finding.begins[1:], finding.deviations[1:], strict=True)
            then = ", ".join(f"{size:.2g} m from {moment:.1f} s on" for moment, size in later)
            return (
                f"the noise changes: {finding.deviations[0]:.2g} m at first, {then}; every frame is weighed by its own"
            )
        case DepthNoise():
            ratio = finding.along / finding.across
            told = (
                "nothing"
                if finding.told is None
                else f"covariances with a ratio of {finding.told:.2g}, not {ratio:.2g},"
            )
            return (
                f"depths have a noise of {finding.along:.2g} m, places across the line of sight one of "
                f"{finding.across:.2g} m, which {told} told; every observation is weighed by that"
            )
        case MovingFeatures():
            verb = "move" if len(finding.labels) > 1 else "moves"
            return f"{', '.join(finding.labels)} {verb} on the body, as on a panel that bends: left out"
        case HeldFrames():
            return (
                f"{counted(finding.frames, 'frame repeats', 'frames repeat')} the one before in every digit, from "
                f"{finding.begin:.1f} to {finding.end:.1f} s, as of a tracker that lost the body: left out"
            )


def summary(result: Estimate) -> list[str]:
    """The options that a method chose, and its predicted accuracy, in a few lines."""
    if isinstance(result.details, ScrewDetails):
        return _screw_summary(result, result.details)
    noise = (
        f"noise √{result.noise.a_posteriori**2:.3g} times that of the tracks' covariances"
        if result.noise.relative
        else f"noise {result.noise.a_posteriori:.3g} m per axis"
    )
    if result.noise.lasting > 1:
        noise += f", the same in {result.noise.lasting:.3g} frames"
    features = f", features {', '.join(result.rejected_features)}" if result.rejected_features else ""
    lines = [
        f"trajectory {result.path}; {noise}; {100 * result.rejected_share:.2g} % of the observations rejected{features}"
    ]
    if result.observability is not None and result.predicted_rmse is not None:
        lines.append(f"centre of mass {verdict(result.observability)}; path ±{result.predicted_rmse:.2g} m RMSE")
    summed = [one for one in result.forces if not one.name.startswith(HIDDEN)]
    lines += [f"{one.name} {_measured(one)}" for one in summed]
    if result.process_noise is not None and result.process_noise.source != "none":
        lines.append(_process_noise(result.process_noise))
    if result.status is Status.NOT_CONVERGED:
        lines.append("did not converge: the result is a rough approximation only")
    elif not result.status.trustworthy:
        lines.append(f"{result.status}: not to be trusted, for what is noted here")
    return lines + [f"note: {sentence(finding)}" for finding in result.findings]


def _measured(force: Factor) -> str:
    unit = "" if force.unit == "1" else f" {force.unit}"
    return f"{force.value:.3g} ± {force.deviation:.2g}{unit}"


def _to_its_digits(value: float, deviation: float) -> str:
    """A value with as many decimals as two digits of its deviation have."""
    decimals = max(1 - math.floor(math.log10(deviation)), 0) if deviation > 0 else 6
    return f"{value:.{decimals}f} ± {deviation:.{decimals}f}"


def _process_noise(noise: ProcessNoise) -> str:
    """The density with its unit, and whether it differs from zero."""
    unit = "m²" if noise.of_position else "m²/s³"
    explained = "" if noise.displacement is None else f", {noise.displacement:.2g} m rms of the path"
    if noise.source == "given":
        return f"process noise {noise.density:.2g} {unit} as given{explained}"
    if noise.interval is None:
        return f"process noise {noise.density:.2g} {unit}{explained}"
    if noise.negligible:
        return f"process noise not seen: below {noise.interval[1]:.2g} {unit}"
    low, high = noise.interval
    return f"process noise {noise.density:.2g} {unit} ({low:.2g} to {high:.2g}){explained}"


def _screw_summary(result: Estimate, details: ScrewDetails) -> list[str]:
    options = result.options
    assert isinstance(options, ScrewOptions)  # noqa: S101  the screw methods take no others
    chosen = ", ".join(details.chosen) or "none"
    return [
        f"lag {options.lag:g} s, cut-off {options.cutoff:.3g} Hz, degree {options.degree} "
        f"(chosen from the data: {chosen})",
        f"rms of the registration {result.noise.a_posteriori:.3g} m, of the path's fit {details.fit_rms:.3g} m, "
        f"of the segments between successive axes {details.segment_rms:.3g} m",
        f"no covariance; {untested(result.method)}",
    ]


def untested(method: str) -> str:
    """What is to be said of a method that has no status but good: what is wrong with its path, it cannot know."""
    return f"{method} does not test its models: where they are wrong, nothing here says so"


def _vector(direction: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in direction) + ")"

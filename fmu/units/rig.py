"""StereoRig as a unit: a pair of cameras that samples the target's features; from baryscope.models.sensor.rig."""

from collections.abc import Mapping

import numpy as np

from baryscope.fmu.units.blueprint import (
    Blueprint,
    Core,
    FloatArray,
    Section,
    UnitKind,
    feature_count,
    setting_of,
    starts_of,
)
from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario, StereoRig
from baryscope.models.sensor.draws import Purpose
from baryscope.models.sensor.rig import LARGEST_SEED, MOST_PENDING, StereoSystem, rig_table, stereo_system
from baryscope.models.variables import Variable

NAME = "StereoRig"
USUAL = StereoRig(focal_length=1911.0, baseline=1.0, pixel_noise=0.5)
"""The rig of a scenario that has none."""
FARTHEST = 1e9  # m; without a limit of the range

_FRAMES = (
    ("C, chaser", "Origin at the chaser's centre of mass, inertial axes: the frame of features and normals."),
    (
        "V, camera",
        "Axes of both cameras: x along the baseline from the left camera to the right one, z along the boresight, y "
        "completes them. Origin of points at the left camera, which is at camera.leverArm from the chaser's centre of "
        "mass: a point in C is R(camera.attitude) (point + camera.leverArm).",
    ),
)
_EQUATIONS = (
    "Samples are taken at start + k sampling.period. A step takes those from its beginning on and before its end, with "
    "the inputs of its beginning, of which sample.time is the time; their outputs are there at the end of the step in "
    "which sampling.latency is over.",
    "Pixels: f X/Z, f Y/Z and f (X - B)/Z, each with normal noise of camera.pixelNoise, from the corner of the images. "
    "Points are triangulated from the noisy pixels; their covariance is that of the pixels to first order, there.",
    "A feature is seen while it faces the camera (visibility.maxIncidence), is in range, lies before the camera and in "
    "both images with a disparity that tells a depth (below 1e5 baselines), the target is lit (more than half of the "
    "Sun's disc is over the limb of the sphere sun.shadowRadius), and it is not dropped.",
    "Blunders, a share of all observations, are displaced by a normal vector of rms length outliers.size. The measured "
    "attitude is turned by normal angles of camera.attitudeNoise about the camera's axes.",
    "Random numbers are Philox4x64-10 of (seed, purpose) and (k + 1, feature): each draw depends on nothing else, so "
    "that a restored state draws the same. They are those of baryscope's campaigns.",
)
_USE = (
    "Connect features and normals to those of TumblingTarget, orbit.position where that has it, and camera.attitude to "
    "what points the chaser. Where orbit.position is not connected, the target is lit.",
    "What is not seen is 0, and seen is false. sample.number counts the samples that have been out, from 0.",
    "Fixed parameters are set before or in Initialization Mode, tunable ones also between steps.",
    "States can be saved and restored bitwise; what follows is drawn again as it was.",
)


def rig_blueprint(scenario: Scenario) -> Blueprint:
    """The rig that looks at a scenario's target, with the scenario's sensor as start values.

    Raises:
        InputError: the seed is no number that a Real can hold.
    """
    if scenario.run.seed > LARGEST_SEED:
        raise InputError(f"run.seed: found {scenario.run.seed}, expected below 2**53 for the unit {NAME}")
    system = stereo_system(len(scenario.features.points))
    return Blueprint(
        name=NAME,
        summary="A pair of cameras that samples a target's features: pixels, triangulated points with covariances, and "
        "which features are seen",
        variables=system.variables,
        starts=_starts(scenario, system),
        core=_core(system, len(scenario.features.points)),
        setting=setting_of(scenario),
        sections=(
            Section(
                "Frames", "Quaternions are (w, x, y, z). Units are SI, pixels and pure numbers have none.", rows=_FRAMES
            ),
            Section("What it measures", items=_EQUATIONS),
        ),
        use=_USE,
    )


def _starts(scenario: Scenario, system: StereoSystem) -> dict[str, FloatArray]:
    sensor, tracking, light = scenario.sensor, scenario.tracking, scenario.light
    rig = sensor.stereo or USUAL
    resolution = np.array(rig.resolution or (0, 0))
    facing = tracking.visibility == "facing"
    given = {
        "camera.attitude": (1.0, 0.0, 0.0, 0.0),
        "sun.direction": (1.0, 0.0, 0.0) if light is None else light.sun,
        "camera.focalLength": rig.focal_length,
        "camera.principalPoint": resolution / 2,
        "camera.resolution": resolution,
        "camera.baseline": rig.baseline,
        "camera.pixelNoise": rig.pixel_noise,
        "sampling.period": scenario.run.sample_time,
        "visibility.maxIncidence": np.deg2rad(tracking.max_incidence_deg) if facing else np.pi,
        "visibility.maxRange": FARTHEST,
        "dropout": sensor.dropout,
        "outliers.share": sensor.outliers.share,
        "outliers.size": sensor.outliers.size,
        "sun.shadowRadius": 0.0 if light is None else light.shadow_radius,
        "seed": scenario.run.seed,
    }
    return starts_of(system.variables, given)


def _core(system: StereoSystem, features: int) -> Core:
    return Core(
        functions=(system.sight, system.attitude, system.light, system.checks.margins, system.checks.found),
        checks={"CHECKS": system.checks.checks},
        headers=("rig.h", "sampled.h"),
        files=("rig.c", "sampled.c"),
        sizes={f"DRAW_{purpose.name}": purpose.value for purpose in Purpose}
        | {"N_FEATURES": features, "MOST_PENDING": MOST_PENDING},
    )


def _table(described: Mapping[str, tuple[int, ...]]) -> tuple[Variable, ...]:
    return rig_table(feature_count(described, "normals"))


RIG = UnitKind(NAME, rig_blueprint, _table)

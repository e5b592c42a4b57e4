"""CentreOfMassEstimator as a unit: the online filter behind a rig; from baryscope.models.sensor.navigation."""

from collections.abc import Mapping

from numpy.typing import ArrayLike

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
from baryscope.fmu.units.filter import (
    MOST_FEATURES,
    OFFSET,
    SPEED,
    THRUST,
    filter_functions,
    filter_headers,
    work_of,
)
from baryscope.models.errors import InputError
from baryscope.models.orbit import EARTH_RADIUS, orbit_parameters
from baryscope.models.scenario import Scenario
from baryscope.models.sensor.navigation import NavigationSystem, navigation_system, navigation_table
from baryscope.models.variables import Variable

NAME = "CentreOfMassEstimator"
STEREO_SIGMA = 0.05  # m, of points that come without covariances

_FRAMES = (
    ("C, chaser", "Origin at the chaser's centre of mass, inertial axes: the frame of all estimates."),
    (
        "V, camera",
        "Axes of the points that are measured; a point in C is R(camera.attitude) (point + camera.leverArm).",
    ),
    (
        "B, body",
        "Origin at the target's centre of mass, fixed in the target; its axes are those of C at the first sample.",
    ),
    (
        "L, LVLH",
        "Axes of the command, by orbit.* also where onOrbit is false: x radially outward, y along-track, z along the "
        "orbit's normal.",
    ),
)
_EQUATIONS = (
    "A Kalman filter of the target's centre of mass and of its features. The attitude is free in every sample, so that "
    "nothing is assumed of inertia and tumble; the centre of mass moves on the relative orbit, under J2 where orbit.j2 "
    "is not 0, or freely, with white acceleration of a density that is estimated.",
    "A sample is taken in the step that begins with another sample.number than before, not 0, as of sample.time. What "
    "the command changed since then is in the outputs, which are of the step's end; of more than 64 steps since the "
    "last sample, neighbours are taken together.",
    "Left out, and logged as a warning, are a sample.time that is not after that of the last sample, one that is under "
    "the same sample.number, and points whose covariance is not positive definite where others have one; a sample.time "
    "after the step's end waits. A sample.number that is less than before is logged, and its sample taken.",
    "Features that do not fit are left out; one that returns is known by its number; after ten samples without a fit "
    f"the filter begins with another map. It holds up to {MOST_FEATURES} features.",
    "The chaser's thrusters may be wrong by a scale and a misalignment in the camera's axes, of the deviation "
    "filter.thrust: both are estimated from the first command on. Between samples these axes are those of the "
    "middle, on the parabola through the last three; samples without points tell of them, too.",
    "After a turn of the target further filters know a free tumble: attitude, rate and inertia are then those of the "
    "step's end. Where the attitudes contradict it, it is given up and learnt anew.",
    "sight.residuals tell by how much each point of the last sample is off the map, in the pose that fits best. Of a "
    "sample for which there is none, all points are rejected. One that is not in the map yet neither fits nor is it "
    "rejected.",
    "navigation.valid says that the centre of mass is less uncertain than the features are far from each other, and "
    "that residuals are as large as expected. Covariances are there from the first sample on.",
)
_USE = (
    "Connect points, covariances, seen, sample.time and sample.number to StereoRig, camera.attitude to its "
    "camera.measuredAttitude, and chaser.acceleration to what commands the chaser: of thrust that it is not told of, "
    "estimates and claims are wrong.",
    "Without a rig of ours, raise sample.number by 1 with every sample.",
    "Fixed parameters are set before or in Initialization Mode, prediction.horizon also between steps.",
    "States can be saved and restored bitwise: the filter is one piece of memory of fixed size.",
)


def estimator_blueprint(scenario: Scenario) -> Blueprint:
    """The estimator for a scenario's features, orbit and sensor.

    Raises:
        InputError: it has more features than the filter's map holds.
    """
    count = len(scenario.features.points)
    if count > MOST_FEATURES:
        raise InputError(f"features: found {count}, expected at most {MOST_FEATURES} for the unit {NAME}")
    system = navigation_system(count)
    return Blueprint(
        name=NAME,
        summary="The online estimator of a tumbling target's centre of mass, from the points that a rig measures",
        variables=system.variables,
        starts=_starts(scenario, system),
        core=_core(system, count),
        setting=setting_of(scenario),
        sections=(
            Section("Frames", "Quaternions are (w, x, y, z). Units are SI.", rows=_FRAMES),
            Section("How it estimates", items=_EQUATIONS),
        ),
        use=_USE,
    )


def _starts(scenario: Scenario, system: NavigationSystem) -> dict[str, FloatArray]:
    given: dict[str, ArrayLike] = {
        "camera.attitude": (1.0, 0.0, 0.0, 0.0),
        "filter.sigma": scenario.sensor.noise or STEREO_SIGMA,
        "filter.offset": OFFSET,
        "filter.speed": SPEED,
        "filter.thrust": THRUST,
        "onOrbit": 1.0,
    }
    oblateness: dict[str, ArrayLike] = {
        "orbit.j2": scenario.orbit.j2 or 0.0,
        "orbit.equatorialRadius": scenario.orbit.equatorial_radius or EARTH_RADIUS,
    }
    return starts_of(system.variables, given | orbit_parameters(scenario.orbit) | oblateness)


def _core(system: NavigationSystem, features: int) -> Core:
    return Core(
        functions=(
            system.point,
            system.attitude,
            system.push,
            *filter_functions(),
            system.checks.margins,
            system.checks.found,
        ),
        checks={"CHECKS": system.checks.checks},
        headers=("navigation.h", "sampled.h"),
        files=("navigation.c", "sampled.c"),
        sizes={"N_FEATURES": features} | work_of(filter_functions()),
        generated=filter_headers(),
    )


def _table(described: Mapping[str, tuple[int, ...]]) -> tuple[Variable, ...]:
    return navigation_table(feature_count(described, "points"))


ESTIMATOR = UnitKind(NAME, estimator_blueprint, _table)

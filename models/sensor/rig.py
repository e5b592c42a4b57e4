"""StereoRig: what the unit of that name measures, as a table of variables and CasADi functions.

A rectified pair of cameras samples the features at t = start + k T. A sample is drawn with random numbers by counter
(`draws`), whose frame is k, and is out `latency` later. Frames: C has its origin at the chaser's CoM and inertial axes;
V, the camera's axes, are those of `stereo`, with the left camera at the lever arm.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import inf, pi

import casadi as ca

from baryscope.models.attitude import upper_elements
from baryscope.models.checks import UNIT_TOLERANCE, Check, CheckSet, symbols_of
from baryscope.models.forces import Sunlight, sunlit_share
from baryscope.models.frames import Symbol, normalised, quaternion_product, rotation_from_quaternion
from baryscope.models.sensor.draws import normals_of
from baryscope.models.stereo import (
    FACING_TOLERANCE,
    facing_cosine,
    image_margins,
    projection,
    spread,
    tells_depth,
    triangulation,
)
from baryscope.models.variables import BELOW_ONE, CAMERA, NOT_NEGATIVE, UPPER, Kind, Variable

MOST_PENDING = 16  # samples that wait for their latency
SHORTEST_PERIOD = 1e-6  # s
LARGEST_SEED = 2.0**53 - 1
LIT = 0.5  # share of the Sun's disc that is needed
UV = ("u", "v")
PIXELS = ("u, left", "v", "u, right")


@dataclass(frozen=True)
class StereoSystem:
    """The measurement for one number of features.

    Attributes:
        variables: the table.
        sight: p_C, n_C, q_C_V, parameters, three draws of four uniform numbers (noise, fate, blunder) → pixels, point
            in V, upper triangle of its covariance, 1 where it is seen and else 0.
        attitude: q_C_V, parameters, four uniform numbers → the unit quaternion that a star tracker measures.
        light: inputs → 1 while the target is lit, else 0.
        checks: the conditions on the parameters.
    """

    variables: tuple[Variable, ...]
    sight: ca.Function
    attitude: ca.Function
    light: ca.Function
    checks: CheckSet


@cache
def stereo_system(feature_count: int) -> StereoSystem:
    """Build the symbolic system for a target with `feature_count` features."""
    table = rig_table(feature_count)
    given, p = symbols_of(table, Kind.PARAMETER)
    q = ca.SX.sym("q", 4)
    point, normal = ca.SX.sym("point", 3), ca.SX.sym("normal", 3)
    draws = [ca.SX.sym(name, 4) for name in ("noise", "fate", "blunder")]
    position, sun, radius = ca.SX.sym("position", 3), ca.SX.sym("sun", 3), ca.SX.sym("radius")
    share = sunlit_share(position, Sunlight(normalised(sun), ca.SX(0), radius))
    return StereoSystem(
        variables=table,
        sight=ca.Function("rig_sight", [point, normal, q, p, *draws], _sight(point, normal, q, given, draws)),
        attitude=_attitude(q, p, given),
        light=ca.Function("rig_light", [position, sun, radius], [ca.if_else(share >= LIT, 1, 0)]),
        checks=CheckSet.over(p, _checks(given), "unit"),
    )


def _sight(
    point_C: Symbol, normal_C: Symbol, q: Symbol, given: Mapping[str, Symbol], draws: list[Symbol]
) -> list[Symbol]:
    noise, fate, blunder = draws
    f, baseline, sigma = given["camera.focalLength"], given["camera.baseline"], given["camera.pixelNoise"]
    R_C_V = rotation_from_quaternion(normalised(q))
    arm = given["camera.leverArm"]
    true_V, normal_V = R_C_V.T @ point_C - arm, R_C_V.T @ normal_C
    wrong = ca.if_else(fate[1] < given["outliers.share"], 1, 0)
    offset_C = wrong * given["outliers.size"] / ca.sqrt(3) * normals_of(blunder)
    there_V = true_V + R_C_V.T @ offset_C
    pixels = projection(there_V, f, baseline) + sigma * normals_of(noise)
    point_V = triangulation(pixels, f, baseline)
    root = spread(pixels, f, baseline, sigma)
    covariance = root @ root.T
    centre = ca.vertcat(given["camera.principalPoint"], given["camera.principalPoint"][0])
    in_image = pixels + centre
    resolution = given["camera.resolution"]
    sizes, margins = (resolution[0], resolution[1], resolution[0]), image_margins(in_image, resolution)
    distance = ca.norm_2(true_V)
    conditions = [
        there_V[2] > 0,
        tells_depth(pixels[0] - pixels[2], f),
        *(ca.logic_or(size == 0, margin >= 0) for size, margin in zip(sizes, ca.vertsplit(margins), strict=True)),
        facing_cosine(true_V, normal_V) >= ca.cos(given["visibility.maxIncidence"]) - FACING_TOLERANCE,
        distance >= given["visibility.minRange"],
        distance <= given["visibility.maxRange"],
        fate[0] >= given["dropout"],
    ]
    seen = ca.SX(1)
    for condition in conditions:
        seen = ca.logic_and(seen, condition)
    return [in_image, point_V, upper_elements(covariance), ca.if_else(seen, 1, 0)]


def _attitude(q: Symbol, p: Symbol, given: Mapping[str, Symbol]) -> ca.Function:
    """q ⊗ (1, θ/2), normalised: θ about the camera's axes, normal, to second order a turn by θ."""
    u = ca.SX.sym("u", 4)
    turned = quaternion_product(q, ca.vertcat(1, given["camera.attitudeNoise"] / 2 * normals_of(u)))
    return ca.Function("rig_attitude", [q, p, u], [normalised(turned)])


def rig_table(feature_count: int) -> tuple[Variable, ...]:
    """The variables of StereoRig for so many features."""
    n = feature_count
    IN, PAR, OUT = Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT
    attitude, unseen = "ttitude quaternion (w, x, y, z), camera to inertial", "; 0 if not seen"
    return (
        Variable("features", IN, "m", "Positions of the features, frame C (chaser, inertial axes)", (n, 3)),
        Variable("normals", IN, "1", "Outward unit normals at the features, frame C", (n, 3)),
        Variable("camera.attitude", IN, "1", f"A{attitude}", (4,)),
        Variable("orbit.position", IN, "m", "The target from the centre it circles, inertial axes", (3,), display="km"),
        Variable("sun.direction", IN, "1", "Direction to the Sun, inertial axes, of any length", (3,)),
        Variable("camera.focalLength", PAR, "1", "Focal length, px", limits=NOT_NEGATIVE),
        Variable("camera.principalPoint", PAR, "1", "Principal point from the corner of an image, px", (2,), axes=UV),
        Variable(
            "camera.resolution", PAR, "1", "Size of both images, px; 0: no limit", (2,), axes=UV, limits=NOT_NEGATIVE
        ),
        Variable("camera.baseline", PAR, "m", "Distance of the right camera from the left one", limits=NOT_NEGATIVE),
        Variable("camera.leverArm", PAR, "m", "Left camera from the chaser's CoM, camera axes", (3,), axes=CAMERA),
        _tunable("camera.pixelNoise", "1", "Standard deviation of a pixel coordinate, px"),
        _tunable("camera.attitudeNoise", "rad", "Standard deviation of the measured attitude, each axis", (0.0, pi)),
        Variable("sampling.period", PAR, "s", "Time from sample to sample", limits=(SHORTEST_PERIOD, inf)),
        Variable("sampling.latency", PAR, "s", "Time from a sample to its output", limits=NOT_NEGATIVE),
        Variable(
            "visibility.maxIncidence", PAR, "rad", "Largest angle between a normal and the direction to the camera",
            tunable=True, limits=(0.0, pi),
        ),
        _tunable("visibility.minRange", "m", "Smallest distance of a feature that is seen"),
        _tunable("visibility.maxRange", "m", "Largest distance of a feature that is seen"),
        _tunable("dropout", "1", "Share of observations that are lost", limits=BELOW_ONE),
        _tunable("outliers.share", "1", "Share of observations that are blunders", limits=BELOW_ONE),
        _tunable("outliers.size", "m", "Root mean square length of a blunder"),
        Variable(
            "sun.shadowRadius", PAR, "m", "Radius of the sphere that shades the target; 0: none", display="km",
            limits=NOT_NEGATIVE,
        ),
        Variable("seed", PAR, "1", "Seed of all random numbers, whole", limits=(0.0, LARGEST_SEED)),
        Variable("pixels", OUT, "1", f"Pixels from the corner, px{unseen}", (n, 3), axes=PIXELS, discrete=True),
        Variable("points", OUT, "m", f"Triangulated points, camera axes{unseen}", (n, 3), axes=CAMERA, discrete=True),
        Variable("covariances", OUT, "m2", f"Covariances of the points{unseen}", (n, 6), axes=UPPER, discrete=True),
        Variable("seen", OUT, "1", "Whether the feature is seen", (n,), boolean=True, per_feature=True, discrete=True),
        Variable("camera.measuredAttitude", OUT, "1", f"Measured a{attitude}", (4,), discrete=True),
        Variable("sample.time", OUT, "s", "Time of the inputs that the sample in the outputs is of", discrete=True),
        Variable("sample.number", OUT, "1", "Number of samples that have been out", limits=NOT_NEGATIVE, discrete=True),
    )  # fmt: skip


def _tunable(name: str, unit: str, what: str, limits: tuple[float, float] = NOT_NEGATIVE) -> Variable:
    """A tunable number that is not negative."""
    return Variable(name, Kind.PARAMETER, unit, what, tunable=True, limits=limits)


def _checks(given: Mapping[str, Symbol]) -> tuple[Check, ...]:
    """The conditions on the parameters, in the order of reporting."""

    def check(name: str, expected: str, found: Symbol, holds: Symbol) -> Check:
        return Check(name, name, expected, "value", found, ca.if_else(holds, 1, -1))

    def positive(name: str, what: str) -> Check:
        return check(name, f"a {what} above 0", given[name], given[name] > 0)

    def not_negative(name: str) -> Check:
        return check(name, "a value of at least 0", given[name], given[name] >= 0)

    def angle(name: str) -> Check:
        return check(name, "0 to pi rad", given[name], ca.logic_and(given[name] >= 0, given[name] <= pi))

    def share(name: str) -> Check:
        return check(name, "a share from 0 to below 1", given[name], ca.logic_and(given[name] >= 0, given[name] < 1))

    period, latency, seed = given["sampling.period"], given["sampling.latency"], given["seed"]
    resolution = ca.mmin(given["camera.resolution"])
    nearest, farthest = given["visibility.minRange"], given["visibility.maxRange"]
    longest = MOST_PENDING - 1
    return (
        positive("camera.focalLength", "length in px"),
        check("camera.resolution", "sizes of at least 0 px", resolution, resolution >= 0),
        positive("camera.baseline", "length in m"),
        not_negative("camera.pixelNoise"),
        angle("camera.attitudeNoise"),
        check("sampling.period", f"at least {SHORTEST_PERIOD:g} s", period, period >= SHORTEST_PERIOD),
        check(
            "sampling.latency", f"0 to {longest} periods", latency,
            ca.logic_and(latency >= 0, latency <= (longest + UNIT_TOLERANCE) * period),
        ),
        angle("visibility.maxIncidence"),
        not_negative("visibility.minRange"),
        check("visibility.maxRange", "at least visibility.minRange", farthest, farthest >= nearest),
        share("dropout"),
        share("outliers.share"),
        not_negative("outliers.size"),
        not_negative("sun.shadowRadius"),
        check(
            "seed", "a whole number from 0 to below 2**53", seed,
            ca.logic_and(ca.logic_and(seed >= 0, seed <= LARGEST_SEED), seed == ca.floor(seed)),
        ),
    )  # fmt: skip

"""The presets: what they promise in name and comments, against hulls written down here and an own integration."""

import re
import tomllib
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.models.scenario import load_scenario, preset_names
from baryscope.models.sensor.tracking import tracked

RATES = {"envisat": 3.5, "envisat-slow": 1.6, "tiangong": 2.2, "upper-stage": 5.0, "cubesat-class": 6.0}  # deg/s
RATE_TOLERANCE = 0.02  # of the rate
SURFACE_TOLERANCE = 0.011  # m: coordinates are given to the centimetre
NUTATION = 8.0  # deg between ω and the angular momentum at the start, so that screw axes cross


def box(low, high):
    return ("box", np.array(low), np.array(high))


def tube(x_low, x_high, radius):
    return ("tube", (x_low, x_high), radius)


ENVISAT = [
    box((-6.14, -1.38, -1.18), (3.88, 1.37, 0.90)),  # bus
    box((-3.40, -5.00, -1.50), (-2.10, 5.00, -1.50)),  # radar antenna
    box((5.90, -2.49, 0.50), (19.90, 2.49, 0.50)),  # solar array
]
HULLS = {
    "envisat": ENVISAT,
    "envisat-slow": ENVISAT,
    "tiangong": [
        tube(-0.4, 4.6, 1.675),
        tube(-5.8, -0.4, 1.25),
        box((-4.4, 2.0, 0.0), (-1.4, 9.0, 0.0)),
        box((-4.4, -9.0, 0.0), (-1.4, -2.0, 0.0)),
    ],
    "upper-stage": [tube(-5.5, 5.5, 2.0), tube(-6.9, -5.5, 0.9)],
    "cubesat-class": [
        box((-0.30, -0.345, -0.17), (0.26, 0.405, 0.15)),
        box((0.10, 0.405, 0.02), (0.10, 0.525, 0.02)),
        box((-0.42, 0.08, -0.05), (-0.30, 0.08, -0.05)),
    ],
}


def outward_faces(solid, point):
    """Outward normals of the faces of a solid that the point lies on; empty where it is off the surface."""
    kind, low, high = solid
    if kind == "box":
        if np.any(point < low - SURFACE_TOLERANCE) or np.any(point > high + SURFACE_TOLERANCE):
            return []
        sides = [(axis, -1.0) for axis in range(3) if abs(point[axis] - low[axis]) < SURFACE_TOLERANCE]
        sides += [(axis, 1.0) for axis in range(3) if abs(point[axis] - high[axis]) < SURFACE_TOLERANCE]
        return [sign * np.eye(3)[axis] for axis, sign in sides]
    (x_low, x_high), radius = low, high
    distance = np.hypot(point[1], point[2])
    if not x_low - SURFACE_TOLERANCE < point[0] < x_high + SURFACE_TOLERANCE or distance > radius + SURFACE_TOLERANCE:
        return []
    faces = [np.array([sign, 0, 0]) for end, sign in ((x_low, -1), (x_high, 1)) if abs(point[0] - end) < 0.01]
    if abs(distance - radius) < SURFACE_TOLERANCE:
        faces.append(np.array([0, point[1], point[2]]) / distance)
    return faces


@pytest.fixture(params=sorted(RATES))
def preset(request):
    return load_scenario(request.param)


def text_of(name):
    return (files("baryscope.models") / "presets" / f"{name}.toml").read_text(encoding="utf-8")


def test_the_list_of_presets():
    assert preset_names() == sorted(RATES)


@pytest.mark.parametrize("name", sorted(RATES))
def test_the_file_says_where_its_numbers_are_from(name):
    text = text_of(name)
    assert "# Published: " in text
    assert "# Assumed: " in text
    assert text.count("\n") < 100
    description = tomllib.loads(text)["description"]
    assert description
    assert "\n" not in description
    assert len(description) < 100


def test_rate(preset):
    rate = np.array(preset.target.angular_rate_deg)
    assert np.linalg.norm(rate) == pytest.approx(RATES[preset.name], rel=RATE_TOLERANCE)
    momentum = np.array(preset.target.inertia) @ rate
    cosine = rate @ momentum / np.linalg.norm(rate) / np.linalg.norm(momentum)
    assert np.rad2deg(np.arccos(cosine)) > NUTATION


def test_description_names_the_rate(preset):
    assert f"{RATES[preset.name]:g} °/s" in preset.description


def test_features_lie_on_the_hull_and_look_outward(preset):
    for point in preset.features.points:
        faces = [face for solid in HULLS[preset.name] for face in outward_faces(solid, np.array(point.position))]
        assert faces, f"{point.label} is off the hull"
        assert max(face @ point.normal for face in faces) > 0.5, f"{point.label} looks inward"
        beyond = np.array(point.position) + 0.05 * np.array(point.normal)
        assert not any(
            kind == "box" and np.all(beyond > low) and np.all(beyond < high) for kind, low, high in HULLS[preset.name]
        ), f"{point.label} looks into a box"


def test_features_are_no_toy(preset):
    """Eight to twelve, spread in three dimensions, and their mean is nowhere near the CoM."""
    points = np.array([point.position for point in preset.features.points])
    assert 8 <= len(points) <= 12
    spreads = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    assert spreads[2] > 0.03 * spreads[0]
    assert np.linalg.norm(points.mean(axis=0)) > 0.005 * np.ptp(points, axis=0).max()


def test_run_and_intervals(preset):
    assert 5400 < preset.duration < 6100
    assert preset.run.sample_time == 1.0
    intervals = preset.tracking.intervals
    assert intervals[0].start >= 0
    assert intervals[-1].end <= preset.duration
    assert all(before.end <= after.start for before, after in pairwise(intervals))
    assert len({interval.features for interval in intervals}) >= 2
    if preset.tracking.visibility == "all":
        assert all(4 <= len(interval.features) <= 6 for interval in intervals)
    for interval in intervals:
        points = np.array([p.position for p in preset.features.points if p.label in interval.features])
        spreads = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        assert spreads[1] > 0.1 * spreads[0], "a cluster on a line says nothing about the turn about it"


def test_blackouts(preset):
    """At least two stretches within the run of 100 s and more without anything."""
    time = preset.sample_times
    dark = ~tracked(preset, time).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], dark.astype(int), [0]])))
    lengths = edges[1::2] - edges[::2]
    assert np.count_nonzero(lengths >= 100) >= 2
    assert 0.05 < dark.mean() < 0.35


def test_the_set_has_the_kinds_that_the_issue_asks_for():
    presets = {name: load_scenario(name) for name in preset_names()}
    assert presets["envisat"].chaser.position == (0.0, -20.0, 0.0)
    assert presets["envisat"].chaser.velocity == (0.0, 0.0, 0.0)
    assert any(preset.tracking.visibility == "facing" for preset in presets.values())
    assert any(preset.sensor.dropout > 0 for preset in presets.values())
    assert {name: preset.sensor.noise for name, preset in presets.items() if preset.sensor.noise != 0.02} == {
        "cubesat-class": 0.01
    }


def test_the_relative_ellipse_has_no_drift():
    stage = load_scenario("upper-stage")
    n = 2 * np.pi / stage.orbit.period
    assert stage.chaser.velocity[1] == pytest.approx(-2 * n * stage.chaser.position[0], rel=1e-4)
    stated = float(re.search(r"n = √\(μ/a³\) = ([\d.]+)", text_of("upper-stage")).group(1))
    assert stated == pytest.approx(n, rel=1e-5)


def test_inertia_of_the_upper_stage_is_that_of_a_thin_shell():
    """By adding up a million pieces of side and ends, not by the formulae of the comment."""
    L, R, mass = 11.0, 2.0, 3000.0
    angle = (np.arange(1000) + 0.5) * 2 * np.pi / 1000
    along = (np.arange(500) + 0.5) * L / 500 - L / 2
    radius = (np.arange(500) + 0.5) * R / 500
    a, x = np.meshgrid(angle, along)
    side = [x, R * np.cos(a), R * np.sin(a)], np.full(a.shape, 2 * np.pi / 1000 * R * L / 500)
    a, r = np.meshgrid(angle, radius)
    ends = [([0 * r + end, r * np.cos(a), r * np.sin(a)], 2 * np.pi / 1000 * r * R / 500) for end in (-L / 2, L / 2)]
    points = np.concatenate([np.reshape(p, (3, -1)) for p, _ in (side, *ends)], axis=1)
    area = np.concatenate([w.ravel() for _, w in (side, *ends)])
    second = (points * area) @ points.T * mass / area.sum()
    expected = np.trace(second) * np.eye(3) - second
    np.testing.assert_allclose(load_scenario("upper-stage").target.inertia, expected, rtol=1e-4, atol=1.0)


def test_angular_momentum_of_tiangong_leans_as_published():
    """23.1° ± 2.5° from the orbit's normal (Lin et al. 2019)."""
    tiangong = load_scenario("tiangong")
    normal = Rotation.from_euler("ZX", [tiangong.orbit.raan, tiangong.orbit.inclination]).apply([0, 0, 1])
    momentum = Rotation.from_quat(tiangong.target.attitude, scalar_first=True).apply(
        np.array(tiangong.target.inertia) @ tiangong.target.angular_rate_deg
    )
    lean = np.rad2deg(np.arccos(normal @ momentum / np.linalg.norm(momentum)))
    assert lean == pytest.approx(23.1, abs=2.5)

"""Malformed input, and what the one line that refuses it must say: for the readers' tests and the command line's."""

import pytest

# ---- scenario files: a small one that is right, and ways to spoil it ----

GOOD_SCENARIO = """\
description = "a small body"

[target]
inertia = [[2.0, 0.1, 0.0], [0.1, 3.0, 0.2], [0.0, 0.2, 4.0]]
attitude = [1.0, 0.0, 0.0, 0.0]
angular_rate_deg = [1.0, 2.0, 3.0]

[features]
points = [
    { label = "a", position = [1.0, 0.0, 0.0], normal = [1, 0, 0] },
    { label = "b", position = [0.0, 1.0, 0.0], normal = [0, 1, 0] },
    { label = "c", position = [0.0, 0.0, 1.0], normal = [0, 0, 1] },
    { label = "d", position = [-1.0, 0.5, 0.0], normal = [-1, 0, 0] },
]

[orbit]
semi_major_axis = 7.0e6
eccentricity = 0.01
inclination_deg = 50.0

[chaser]
position = [0.0, -10.0, 0.0]

[tracking]
intervals = [
    { start = 0, end = 40, features = ["a", "b", "c"] },
    { start = 60, end = 100, features = ["b", "c", "d"] },
]

[sensor]
noise = 0.02

[run]
duration = 100.0
sample_time = 1.0
seed = 7
"""


def spoil(*replacements):
    """The good scenario with some of its text replaced, each found exactly once."""
    text = GOOD_SCENARIO
    for old, new in replacements:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


INERTIA = "[[2.0, 0.1, 0.0], [0.1, 3.0, 0.2], [0.0, 0.2, 4.0]]"
POINTS = ('{ label = "a",', '{ label = "b",')
ORBIT = "semi_major_axis = 7.0e6"
POSITION = "position = [0.0, -10.0, 0.0]"
RATE = "angular_rate_deg = [1.0, 2.0, 3.0]"
SECOND = "{ start = 60, end = 100,"


def spoilt(id, old, new, *mentions):
    return pytest.param([(old, new)], mentions, id=id)


SCENARIOS = [
    # keys
    spoilt("unknown-table", "[sensor]", "[sensors]", "sensors: unknown field", "expected sensor"),
    spoilt("unknown-key", "seed = 7", "sead = 7", "run.sead: unknown field", "expected seed"),
    spoilt("unknown-key-of-a-point", 'label = "b"', 'label = "b", colour = "red"', "features.points[1].colour: unknown",
           "expected one of label, position, normal"),
    spoilt("missing-table", "[chaser]\n" + POSITION, "", "chaser: missing, expected a table"),
    spoilt("missing-vector", RATE, "", "target.angular_rate_deg: missing, expected a list of 3 numbers in deg/s"),
    spoilt("missing-number", ORBIT, "", "orbit.semi_major_axis: missing, expected a number in m"),
    spoilt("missing-normal", ", normal = [0, 1, 0]", "", "features.points[1].normal: missing, expected a list of 3"),
    spoilt("missing-interval-end", SECOND, "{ start = 60,", "tracking.intervals[1].end: missing",
           "expected a number in s"),
    # units
    spoilt("kilometres-by-name", ORBIT, "semi_major_axis_km = 7000.0", "orbit.semi_major_axis_km: unknown field",
           "expected semi_major_axis in m"),
    spoilt("kilometres-by-value", ORBIT, "semi_major_axis = 7150", "orbit.semi_major_axis: found 7150 m",
           "expected metres"),
    spoilt("unit-in-text", ORBIT, 'semi_major_axis = "7150 km"', "orbit.semi_major_axis: found '7150 km'",
           "expected a number in m"),
    spoilt("rate-without-unit", RATE, "angular_rate = [0.01, 0.02, 0.03]", "target.angular_rate: unknown field",
           "expected angular_rate_deg in deg/s"),
    spoilt("rate-in-radians", RATE, "angular_rate_rad = [0.01, 0.02, 0.03]", "target.angular_rate_rad: unknown field",
           "expected angular_rate_deg in deg/s"),
    spoilt("noise-in-centimetres", "noise = 0.02", "noise_cm = 2", "sensor.noise_cm: unknown", "expected noise in m"),
    spoilt("inclination-without-unit", "inclination_deg", "inclination", "orbit.inclination: unknown field",
           "expected inclination_deg in deg"),
    # shapes
    spoilt("two-coordinates", POSITION, "position = [0.0, -10.0]", "chaser.position: found a list of 2",
           "expected a list of 3 numbers in m"),
    spoilt("four-coordinates", POSITION, "position = [0.0, -10.0, 0.0, 1.0]", "chaser.position: found a list of 4",
           "expected a list of 3 numbers in m"),
    spoilt("scalar-for-a-vector", POSITION, "position = -10.0", "chaser.position: found -10.0",
           "expected a list of 3 numbers in m"),
    spoilt("two-rows-of-inertia", INERTIA, "[[2, 0, 0], [0, 3, 0]]", "target.inertia: found a list of 2",
           "expected a list of 3 lists in kg m²"),
    spoilt("short-row-of-inertia", INERTIA, "[[2, 0, 0], [0, 3], [0, 0, 4]]", "target.inertia[1]: found a list of 2",
           "expected a list of 3 numbers in kg m²"),
    spoilt("diagonal-for-inertia", INERTIA, "[2, 3, 4]", "target.inertia[0]: found 2", "expected a list of 3 numbers"),
    spoilt("three-for-a-quaternion", "attitude = [1.0, 0.0, 0.0, 0.0]", "attitude = [1.0, 0.0, 0.0]",
           "target.attitude: found a list of 3", "expected a list of 4 numbers"),
    pytest.param([('"a small body"', '"a small body"\nrun = 3'),
                  ("[run]\nduration = 100.0\nsample_time = 1.0\nseed = 7\n", "")],
                 ("run: found 3, expected a table",), id="number-for-a-table"),
    spoilt("empty-list-of-features", 'features = ["a", "b", "c"]', "features = []",
           "tracking.intervals[0].features: found a list of 0", "expected at least 1"),
    # types
    spoilt("text-for-a-number", "noise = 0.02", 'noise = "small"', "sensor.noise: found 'small'",
           "expected a number in m"),
    spoilt("boolean-for-a-number", "noise = 0.02", "noise = true", "sensor.noise: found true", "expected a number"),
    spoilt("number-for-a-label", 'label = "b"', "label = 2", "features.points[1].label: found 2", "expected text"),
    spoilt("empty-label", 'label = "b"', 'label = ""', "features.points[1].label: found ''", "expected text that"),
    spoilt("number-for-a-boolean", RATE, RATE + "\ngravity_gradient = 1", "target.gravity_gradient: found 1",
           "expected true or false"),
    spoilt("fractional-seed", "seed = 7", "seed = 7.5", "run.seed: found 7.5", "expected a whole number"),
    pytest.param([('"a small body"', '"a small body"\nsensor = [1, 2]'), ("[sensor]\nnoise = 0.02", "")],
                 ("sensor: found [1, 2], expected a table",), id="list-for-a-table"),
    spoilt("unknown-visibility", "[tracking]", '[tracking]\nvisibility = "some"', "tracking.visibility: found 'some'",
           "expected 'all' or 'facing'"),
    # values
    spoilt("nan", "eccentricity = 0.01", "eccentricity = nan", "orbit.eccentricity: found nan",
           "expected a finite number"),
    spoilt("infinity", POSITION, "position = [0.0, inf, 0.0]", "chaser.position[1]: found inf",
           "expected a finite number in m"),
    spoilt("asymmetric-inertia", INERTIA, "[[2, 0.1, 0], [0.2, 3, 0], [0, 0, 4]]", "target.inertia: found 0.1 in row 1",
           "expected a symmetric tensor in kg m²"),
    spoilt("indefinite-inertia", INERTIA, "[[2, 0, 0], [0, -3, 0], [0, 0, 4]]",
           "target.inertia: found smallest principal moment -3", "expected a positive definite tensor"),
    spoilt("singular-inertia", INERTIA, "[[1, 1, 0], [1, 1, 0], [0, 0, 2]]",
           "target.inertia: found smallest principal moment", "expected a positive definite tensor"),
    spoilt("triangle-inequality", INERTIA, "[[1, 0, 0], [0, 2, 0], [0, 0, 4]]",
           "target.inertia: found largest principal moment over the sum of the others 1.33333",
           "expected no principal moment larger than the sum of the other two"),
    spoilt("parabola", "eccentricity = 0.01", "eccentricity = 1.0", "orbit.eccentricity: found value 1,",
           "expected 0 ≤ e < 1"),
    spoilt("negative-eccentricity", "eccentricity = 0.01", "eccentricity = -0.1",
           "orbit.eccentricity: found value -0.1", "expected 0 ≤ e < 1"),
    spoilt("negative-axis", ORBIT, "semi_major_axis = -7.0e6", "orbit.semi_major_axis: found value -7e+06",
           "expected a length above 0 m"),
    spoilt("massless-earth", ORBIT, ORBIT + "\ngravitational_parameter = 0.0",
           "orbit.gravitational_parameter: found value 0", "expected a value above 0 m³/s²"),
    spoilt("underground", "eccentricity = 0.01", "eccentricity = 0.5", "orbit.semi_major_axis: found 7e+06 m",
           "an orbit above the surface"),
    spoilt("range-zero", POSITION, "position = [0.0, 0.0, 0.0]", "chaser.position: found range in m 0",
           "expected a chaser away from the target's centre of mass"),
    spoilt("zero-normal", "normal = [0, 1, 0]", "normal = [0, 0, 0]",
           "features.points[1].normal: found [0.0, 0.0, 0.0]", "expected a vector of any length above 1e-09"),
    spoilt("long-quaternion", "attitude = [1.0, 0.0, 0.0, 0.0]", "attitude = [1.0, 0.1, 0.0, 0.0]",
           "target.attitude: found length 1.00499", "expected a unit quaternion (w, x, y, z)"),
    spoilt("repeated-label", 'label = "b"', 'label = "a"', "features.points: label 'a' occurs 2 times",
           "expected once"),
    spoilt("unknown-label", 'features = ["a", "b", "c"]', 'features = ["a", "b", "e"]',
           "tracking.intervals[0].features: found 'e'", "expected labels of features.points (a, b, c, d)"),
    spoilt("interval-backwards", SECOND, "{ start = 60, end = 50,", "tracking.intervals[1].end: found 50 s",
           "expected a time after start, 60 s"),
    spoilt("negative-noise", "noise = 0.02", "noise = -0.02", "sensor.noise: found -0.02",
           "expected a value of at least 0"),
    spoilt("everything-dropped", "noise = 0.02", "dropout = 1.0", "sensor.dropout: found 1.0",
           "expected a value below 1"),
    spoilt("incidence-behind", "[tracking]", "[tracking]\nmax_incidence_deg = 120.0",
           "tracking.max_incidence_deg: found 120.0", "expected a value of at most 90", "in deg"),
    spoilt("loose-tolerance", "seed = 7", "tolerance = 0.1", "run.tolerance: found value 0.1",
           "expected a value between 1e-15 and 0.001"),
    spoilt("zero-tolerance", "seed = 7", "tolerance = 0.0", "run.tolerance: found value 0,", "between 1e-15 and 0.001"),
    spoilt("sample-longer-than-run", "sample_time = 1.0", "sample_time = 200.0", "run.sample_time: found 200 s",
           "expected 3 to 2500000 samples of 4 features in the run's 100 s"),
    spoilt("sample-far-too-short", "sample_time = 1.0", "sample_time = 1e-9", "run.sample_time: found 1e-09 s",
           "expected 3 to 2500000 samples"),
    spoilt("no-duration", "duration = 100.0", "duration = 0.0", "run.duration: found 0.0",
           "expected a value of at least 1e-06 in s"),
    spoilt("negative-seed", "seed = 7", "seed = -7", "run.seed: found -7", "expected a value of at least 0"),
    pytest.param([(f"    {point}", "    #") for point in POINTS],
                 ("features.points: found a list of 2", "expected at least 3"), id="two-features"),
    pytest.param([("[1.0, 0.0, 0.0], normal", "[0, 3, 0], normal"), ("[0.0, 0.0, 1.0], normal", "[0, -1, 0], normal"),
                  ("[-1.0, 0.5, 0.0], normal", "[0, 0.5, 0], normal")],
                 ("features.points: found rms distance from a line through them in m 0",
                  "expected at least three features that do not lie on one line"), id="collinear"),
    # numbers that no mission has
    spoilt("far-chaser", "position = [0.0, -10.0, 0.0]", "position = [0.0, 1e150, 0.0]",
           "chaser.position[1]: found 1e+150", "expected a value of at most 1e+09 in m"),
    spoilt("near-chaser", "position = [0.0, -10.0, 0.0]", "position = [0.0, 1e-300, 0.0]",
           "chaser.position: found a range of 1e-300 m", "expected a chaser at least 0.001 m away"),
    spoilt("fast", RATE, "angular_rate_deg = [0.0, 1e300, 0.0]", "target.angular_rate_deg[1]: found 1e+300",
           "expected a value of at most 1e+06 in deg/s"),
    spoilt("light", INERTIA, "[[2e-160, 0, 0], [0, 3e-160, 0], [0, 0, 4e-160]]", "target.inertia: found 2e-160 in",
           "expected a moment of inertia of at least 1e-09 kg m²"),
    spoilt("heavy", INERTIA, "[[2e160, 0, 0], [0, 3e160, 0], [0, 0, 4e160]]", "target.inertia[0][0]: found 2e+160",
           "expected a value of at most 1e+15 in kg m²"),
    spoilt("wide-orbit", ORBIT, "semi_major_axis = 1e150", "orbit.semi_major_axis: found 1e+150 m",
           "expected 1 to 1e+15 m"),
    spoilt("weightless-earth", ORBIT, f"{ORBIT}\ngravitational_parameter = 1e-320",
           "orbit.gravitational_parameter: found 9.99989e-321 m³/s²", "expected 1e-09 to 1e+30 m³/s²"),
    spoilt("inside-a-body", ORBIT, "semi_major_axis = 7.0\ngravitational_parameter = 3e9",
           "orbit.semi_major_axis: found 7 m, where the target passes the periapsis at", "expected at most 0.01 rad/s"),
    spoilt("many-turns-of-raan", ORBIT, f"{ORBIT}\nraan_deg = -1e300", "orbit.raan_deg: found -1e+300",
           "expected a value of at least -1e+06 in deg"),
    spoilt("all-but-parabolic", "eccentricity = 0.01", "eccentricity = 0.99999999999999999",
           "orbit.eccentricity: found value 1, expected 0 ≤ e < 1"),
    spoilt("denormal-sample-time", "sample_time = 1.0", "sample_time = 1e-320",
           "run.sample_time: found 9.99989e-321 s", "expected 3 to 2500000 samples"),
    spoilt("endless", "duration = 100.0\nsample_time = 1.0", "duration = 1e300\nsample_time = 1e299",
           "run.duration: found 1e+300", "expected a value of at most 1e+10 in s"),
    spoilt("many-turns", "duration = 100.0\nsample_time = 1.0", "duration = 1e9\nsample_time = 1e8",
           "run.duration: found 1e+09 s, in which the target makes 1.06e+07 turns", "expected at most 20000 turns"),
    spoilt("denormal-noise", "noise = 0.02", "noise = 1e-320", "sensor.noise: found 9.99989e-321 m",
           "expected 0 or a value of at least 1e-12 in m"),
    spoilt("long-seed", "seed = 7", f"seed = 0x{'f' * 5000}", "run.seed: found a whole number of 20000 bits",
           "expected a value below 1.84467e+19"),
    spoilt("long-number", "seed = 7", f"seed = {'7' * 5000}", "a whole number has too many digits",
           "expected a scenario in TOML"),
    spoilt("long-length", "sample_time = 1.0", f"sample_time = 0x{'f' * 5000}",
           "run.sample_time: found a whole number of 20000 bits", "expected"),
    spoilt("date", "seed = 7", "seed = 1979-05-27", "run.seed: found 1979-05-27", "expected a whole number"),
    spoilt("deep-arrays", "seed = 7", f"seed = {'[' * 100_000}", "nested more than 32 levels deep"),
    spoilt("deep-tables", "seed = 7", f"{'seed.' * 5000}seed = 7", "nested more than 32 levels deep"),
    spoilt("long-file", "seed = 7", f"seed = 7{'#' * 5_000_000}", "more than 5000000 bytes"),
    pytest.param([("    { label = \"d\"", "".join(
        f'    {{ label = "{k}", position = [{k}, 1, 0], normal = [1, 0, 0] }},\n' for k in range(1000)
    ) + "    { label = \"d\"")], ("features.points: found a list of 1004", "expected at most 1000"), id="features"),
    # not TOML
    spoilt("syntax", "eccentricity = 0.01", "eccentricity = ", "line 18", "expected a scenario in TOML"),
    spoilt("comma-for-a-point", "eccentricity = 0.01", "eccentricity = 0,01", "line 18", "expected a scenario in TOML"),
    spoilt("key-twice", "seed = 7", "seed = 7\nseed = 8", "line 37", "expected a scenario in TOML"),
    spoilt("line-break-in-a-key", "seed = 7", '"se\\ned" = 7', "run.se ed: unknown field", "expected seed"),
]  # fmt: skip

# ---- orbit files ----

ORBITS = [
    pytest.param("", "orbit: missing, expected a table", id="empty"),
    pytest.param("[orbit]", "orbit.semi_major_axis: missing, expected a number in m (and 2 more)", id="empty-table"),
    pytest.param("[orbit]\nsemi_major_axis_km = 7150\neccentricity = 0\ninclination_deg = 98",
                 "orbit.semi_major_axis_km: unknown field, expected semi_major_axis in m", id="km"),
    pytest.param("[orbit]\nsemi_major_axis = 7150\neccentricity = 0\ninclination_deg = 98",
                 "orbit.semi_major_axis: found 7150 m, which puts the periapsis 7150 m from the Earth's centre, "
                 "expected metres and an orbit above the surface", id="km-by-value"),
    pytest.param("[orbit]\nsemi_major_axis = 7.15e6\neccentricity = 1.2\ninclination_deg = 98",
                 "orbit.eccentricity: found value 1.2, expected 0 ≤ e < 1", id="hyperbola"),
    pytest.param("[orbit]\nsemi_major_axis = 7.15e6\neccentricity = 0\ninclination_deg = 208\nraan_deg = 98",
                 "orbit.inclination_deg: found 208, expected a value of at most 180 in deg", id="exchanged-angles"),
    pytest.param("[orbit]\nsemi_major_axis = 7.15e6\neccentricity = 0\ninclination_deg = [98, 0]",
                 "orbit.inclination_deg: found [98, 0], expected a number in deg", id="list"),
    pytest.param("[orbit]\nsemi_major_axis = 7.15e6\neccentricity = 0\ninclination_deg = 98\n[chaser]",
                 "holds a scenario, expected an orbit: its table [orbit], alone in a file", id="scenario-for-an-orbit"),
    pytest.param("[orbit]\nsemi_major_axis = 7.15e6\neccentricity = 0\ninclination_deg = 98\n[sensor]",
                 "sensor: unknown field, expected orbit", id="more-than-an-orbit"),
]  # fmt: skip

# ---- tracks ----

HEADER = "time,feature,x,y,z\n"
WIDE = "time,feature,x,y,z,cxx,cxy,cxz,cyy,cyz,czz\n"

# What stands in the file (None: no file), and what the one line must name.
TRACKS = {
    "missing file": (None, ["No such file"]),
    "empty file": ("", ["empty", "header"]),
    "blank lines only": ("\n\n", ["empty", "header"]),
    "header only": (HEADER, ["no rows"]),
    "not UTF-8": (b"time,feature,x,y,z\n0,\xff\xfe,1,2,3\n", ["UTF-8"]),
    "missing column": ("time,feature,x,y\n0,a,1,2\n", ["line 1", "'z'", "missing"]),
    "unknown column": ("time,feature,x,y,z,w\n0,a,1,2,3,4\n", ["line 1", "'w'", "unknown"]),
    "column twice": ("time,feature,x,x,y,z\n0,a,1,1,2,3\n", ["line 1", "'x'", "twice"]),
    "no header": ("0,a,1,2,3\n", ["line 1", "numbers in place of a header", "expected time,feature,x,y,z"]),
    "some covariances": ("time,feature,x,y,z,cxx\n0,a,1,2,3,1\n", ["line 1", "'cxy'", "missing"]),
    "too few cells": (HEADER + "0,a,1,2,3\n1,a,1,2\n", ["line 3", "4 cells", "expected 5"]),
    "too many cells": (HEADER + "0,a,1,2,3,4\n", ["line 2", "6 cells", "expected 5"]),
    "semicolons": ("time;feature;x;y;z\n0;a;1;2;3\n", ["line 1", "separated by semicolons, expected commas"]),
    "tabs": ("time\tfeature\tx\ty\tz\n0\ta\t1\t2\t3\n", ["line 1", "separated by tabs, expected commas"]),
    "blanks": ("time feature x y z\n0 a 1 2 3\n", ["line 1", "separated by blanks, expected commas"]),
    "semicolons and quotes": ('"time";"feature";"x";"y";"z"\n0;a;1;2;3\n', ["line 1", "separated by semicolons"]),
    "semicolons and covariances": (WIDE.replace(",", ";"), ["line 1", "separated by semicolons"]),
    "semicolons and decimal commas": ("time;feature;x;y;z\n0,5;a;1,5;2;3\n", ["semicolons", "points in numbers"]),
    "decimal commas": (
        HEADER + "0,5,a,1,25,2,5,3,0\n",
        ["line 2", "9 cells", "expected 5", "decimal point, not a comma"],
    ),
    "decimal commas in quotes": (
        HEADER + '"0,5",a,"1,25","2,5","3"\n',
        ["column time", "'0,5'", "with a decimal point"],
    ),
    "local times": (HEADER + "2026-05-01T12:00:00 CET,a,1,2,3\n", ["line 2", "column time", "seconds, not a date"]),
    "UTC after seconds": (
        HEADER + "0,a,1,2,3\n2026-05-01T12:00:00Z,a,1,2,3\n",
        ["line 3", "column time", "a number of seconds", "or, from the first row on, a UTC time as"],
    ),
    "seconds after UTC": (
        HEADER + "2026-05-01T12:00:00Z,a,1,2,3\n1,a,1,2,3\n",
        ["line 3", "column time", "found '1'", "expected a UTC time as"],
    ),
    "no such hour in the first row": (
        HEADER + "2026-03-01T24:00:00Z,a,1,2,3\n",
        ["line 2, column time: found '2026-03-01T24:00:00Z'", "expected a UTC time as"],
    ),
    "times of day": (HEADER + "12:00:01.5,a,1,2,3\n", ["line 2", "column time", "not a date or a time of day"]),
    "one cell": (HEADER + "0\n", ["line 2: 1 cell, expected 5"]),
    "not a number": (HEADER + "0,a,1,2,3\n0,b,1,far,3\n", ["line 3", "column y", "'far'", "number"]),
    "infinite position": (HEADER + "0,a,1,inf,3\n", ["line 2", "column y", "'inf'", "finite"]),
    "nan in half a position": (HEADER + "0,a,1,nan,3\n", ["line 2", "column y", "missing", "x, y and z, or none"]),
    "infinite time": (HEADER + "-inf,a,1,2,3\n", ["line 2", "column time", "'-inf'"]),
    "empty time": (HEADER + ",a,1,2,3\n", ["line 2", "column time", "missing"]),
    "nan time": (HEADER + "nan,a,1,2,3\n", ["line 2", "column time", "missing"]),
    "digits grouped": (HEADER + "0,a,1_000,2,3\n", ["line 2", "column x", "'1_000'"]),
    "overflow": (HEADER + "0,a,1e999,2,3\n", ["line 2", "column x", "'1e999'"]),
    "half a position": (HEADER + "0,a,1,2,3\n0,b,1,,3\n", ["line 3", "column y", "missing"]),
    "position without label": (HEADER + "0,,1,2,3\n", ["line 2", "column feature", "empty"]),
    "observation twice": (HEADER + "0,a,1,2,3\n1,a,1,2,3\n0,a,1,2,4\n", ["line 4", "'a'", "twice", "0.0 s"]),
    "quote never closed": (HEADER + '0,"a,1,2,3\n', ["line 2", "CSV"]),
    "half a covariance": (WIDE + "0,a,1,2,3,1,0,0,1,,1\n", ["line 2", "column cyz", "missing"]),
    "covariance of nothing": (WIDE + "0,a,,,,1,0,0,1,0,1\n", ["line 2", "column cxx"]),
    "indefinite covariance": (WIDE + "0,a,1,2,3,1,2,0,1,0,1\n", ["line 2", "positive semidefinite"]),
    "negative variance": (WIDE + "0,a,1,2,3,1,0,0,1,0,-1\n", ["line 2", "positive semidefinite"]),
    "line break in a label": (HEADER + '0,"a\nb",1,2,3\n', ["label", "line break"]),
}

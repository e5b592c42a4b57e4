"""Files that are hostile to a computation: hypothesis strategies for tracks, orbits and options of `estimate`."""

import csv
import io

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

POWERS = (-320, -300, -160, -77, -30, -17, -12, -9, -6, -3, 0, 3, 6, 9, 16, 77, 150, 160, 300)
METHODS = ("screw-raw", "screw-ls", "screw-gpa", "pivot", "ml", "ekf", "score")
GOOD_ORBIT = {
    "semi_major_axis": 7e6,
    "eccentricity": 0.01,
    "inclination_deg": 50.0,
    "true_anomaly_deg": 3.0,
}

signs = st.sampled_from([-1.0, 1.0])
hostile_numbers = (
    st.builds(lambda power, sign: sign * 10.0**power, st.sampled_from(POWERS), signs)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.sampled_from([0.0, -0.0, 1.0, -1.0, 5e-324, 1.7976931348623157e308, 1 - 2**-53, 2.0**63])
)
possible = st.sampled_from([0.0, -0.0, 1e-320, 1e-160, 1e-30, 1.0, 1e3, 1e6, -9e8])
scales = st.sampled_from([1.0, 1e-3, 1e-6, 1e-5, 1e2, 1e4, 1e6, 1e8, 1e-9, 1e-150, 1e150])


def tumbling(seed, n, m, spin):
    """A free body of m features: time (n,) and position (n, m, 3).

    Its moments of inertia are 3, 3 and 2: it precesses at `spin` rad/s about x, 45° from its axis of symmetry, about
    which it turns by (3/2 − 1) cos 45° of that.
    """
    random = np.random.default_rng(seed)
    time = np.arange(n, dtype=np.float64)
    turns = np.stack([spin * time, np.full(n, np.pi / 4), np.sqrt(0.125) * spin * time], axis=1)
    R = Rotation.from_euler("XYZ", turns).as_matrix()
    points = random.uniform(-3, 3, (m, 3))
    centre = np.array([0.0, -20.0, 1.0]) + 0.01 * time[:, None]
    return time, centre[:, None] + points @ np.swapaxes(R, 1, 2) + random.normal(0, 0.01, (n, m, 3))


@st.composite
def times(draw, time):
    """The times, spoilt now and then: scaled, shifted, with a gap, crowded, or with one that is any number."""
    n = len(time)
    for kind in draw(st.lists(st.sampled_from(["gap", "shift", "scale", "crowd", "one"]), max_size=1)):
        if kind == "scale":
            time = time * draw(scales)
        elif kind == "shift":
            time = time + draw(st.sampled_from([1e3, 1.7e9, 9e9, -1e10, 1e300]))
        elif kind == "gap":
            at = draw(st.integers(1, max(n - 1, 1)))
            time = np.concatenate([time[:at], time[at:] + draw(st.sampled_from([10.0, 1e3, 1e4, 1e7, 1e9, 1e12]))])
        elif kind == "crowd":
            at = draw(st.integers(0, n - 1))
            time = np.concatenate([time[:at], time[at] + draw(scales) * np.arange(n - at)])
        else:
            time = time.copy()
            time[draw(st.integers(0, n - 1))] = draw(hostile_numbers)
    return time


@st.composite
def positions(draw, position):
    """The positions, spoilt now and then."""
    n, m, _ = position.shape
    kinds = ["scale", "shift", "one", "feature", "twins", "line", "plane", "point", "still", "huge body", "frozen"]
    for kind in draw(st.lists(st.sampled_from(kinds), max_size=2)):
        position = position.copy()
        k, i = draw(st.integers(0, n - 1)), draw(st.integers(0, m - 1))
        centre = position.mean(axis=1, keepdims=True)
        if kind == "scale":
            position *= draw(scales)
        elif kind == "shift":
            position += draw(st.sampled_from([1e3, -1e5, 1e7, 9e8]))
        elif kind == "one":
            position[k, i, draw(st.integers(0, 2))] = draw(possible | hostile_numbers)
        elif kind == "feature":
            position[:, i] = draw(possible | hostile_numbers)
        elif kind == "twins":
            position[:, i] = position[:, 0] + draw(st.sampled_from([0.0, 1e-300, 1e-12]))
        elif kind == "line":
            position[k:] = centre[k:] + (position[k:] - centre[k:]) * [1.0, draw(st.sampled_from([0.0, 1e-9])), 0.0]
        elif kind == "plane":
            position[:, :, 2] = draw(st.sampled_from([0.0, -0.0, 1e-320, 20.0]))
        elif kind == "point":
            position[k:] = position[k : k + 1, :1]
        elif kind == "still":
            position[:] = position[:1]
        elif kind == "frozen":
            position[k:] = position[k : k + 1]
        else:
            position = centre + (position - centre) * draw(st.sampled_from([1e-2, 1e-5, 1e-6, 1e-9, 1e2, 1e5]))
    return position


@st.composite
def covariances(draw, position):
    """None, or covariances (n, m, 3, 3): good, scaled, nearly singular, zero, or with some that are anything."""
    n, m, _ = position.shape
    if draw(st.integers(0, 2)):
        return None
    random = np.random.default_rng(draw(st.integers(0, 99)))
    values = 1e-4 * 10.0 ** random.uniform(-1, 1, (n, m, 3))
    axes = np.linalg.qr(random.normal(size=(n, m, 3, 3)))[0]
    for kind in draw(st.lists(st.sampled_from(["scale", "flat", "row", "feature", "frame"]), max_size=2)):
        factor = draw(st.sampled_from([1e-2, 1e2, 1e4, 1e8, 1e12, 1e-8, 1e-12, 1e20, 1e-14, 0.0, 1e-320, 1e150]))
        k, i = draw(st.integers(0, n - 1)), draw(st.integers(0, m - 1))
        if kind == "scale":
            values = values * factor
        elif kind == "flat":
            values[..., 0] *= factor
        elif kind == "row":
            values[k, i, draw(st.integers(0, 2)) :] *= factor
        elif kind == "feature":
            values[:, i] *= factor
        else:
            values[k] *= factor
    with np.errstate(all="ignore"):
        covariance = (axes * values[..., None, :]) @ np.swapaxes(axes, 2, 3)
        covariance = (covariance + np.swapaxes(covariance, 2, 3)) / 2
    if draw(st.integers(0, 4)) == 0:
        k, i, row, column = (draw(st.integers(0, high - 1)) for high in (n, m, 3, 3))
        covariance[k, i, row, column] = covariance[k, i, column, row] = draw(hostile_numbers)
    return covariance


@st.composite
def tracks_files(draw):
    """The text of a file of tracks: well-formed rows of a body that is followed, with hostile numbers."""
    n = draw(st.sampled_from([30, 20, 12, 30, 20, 8, 5, 4, 3, 2, 1]))
    m = draw(st.sampled_from([5, 4, 6, 8, 5, 4, 3, 3, 2, 1]))
    spin = draw(st.sampled_from([0.2, 0.2, 0.2, 0.2, 1.0, 3.0, 0.01, 1e-9, 0.0]))
    time, position = tumbling(draw(st.integers(0, 9)), n, m, spin)
    with np.errstate(all="ignore"):
        time, position = draw(times(time)), draw(positions(position))
        covariance = draw(covariances(position))
    seen = np.ones((n, m), dtype=bool)
    if draw(st.integers(0, 2)) == 0:
        seen = np.random.default_rng(draw(st.integers(0, 99))).random((n, m)) < draw(st.sampled_from([0.95, 0.7, 0.3]))
    if draw(st.integers(0, 3)) == 0:  # half of the features are seen in the first half alone, the others in the second
        seen[: n // 2, : m // 2] = False
        seen[n // 2 :, m // 2 :] = False
    return csv_of(time, position, covariance, seen)


def csv_of(time, position, covariance=None, seen=None):
    """The text of a file; rows that hold no number (inf of a scaled value) are written as they are."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    extra = ["cxx", "cxy", "cxz", "cyy", "cyz", "czz"] if covariance is not None else []
    writer.writerow(["time", "feature", "x", "y", "z", *extra])
    for k, i in np.argwhere(np.ones(position.shape[:2]) if seen is None else seen).tolist():
        row = [time[k], f"F{i}", *position[k, i]]
        if covariance is not None:
            row += covariance[k, i][np.triu_indices(3)].tolist()
        writer.writerow([cell if isinstance(cell, str) else repr(float(cell)) for cell in row])
    return stream.getvalue()


cells = hostile_numbers.map(repr) | st.sampled_from(["", "0", "1", "a", "b", "nan", "inf", "1e999", "1,5", '"', "F1"])
tables = st.lists(st.lists(cells, min_size=4, max_size=6), max_size=12).map(
    lambda rows: "\n".join(["time,feature,x,y,z", *(",".join(row) for row in rows)])
)
hostile_tables = st.lists(
    st.tuples(hostile_numbers, st.sampled_from("abcd"), hostile_numbers, hostile_numbers, hostile_numbers),
    min_size=1,
    max_size=40,
).map(lambda rows: "\n".join(["time,feature,x,y,z", *(",".join(map(str, row)) for row in rows)]))


@st.composite
def mangled(draw, texts):
    """A text with some of its characters replaced, taken out or doubled."""
    text = draw(texts)
    for _ in range(draw(st.integers(1, 3))):
        at, length = draw(st.integers(0, len(text))), draw(st.integers(0, 3))
        text = text[:at] + draw(st.text(max_size=3) | cells) + text[at + length :]
    return text


good_orbits = st.sampled_from([{}, {}, {"eccentricity": 0.99, "semi_major_axis": 1e9}, {"semi_major_axis": 1e15}])
hostile_orbits = st.dictionaries(st.sampled_from([*GOOD_ORBIT, "gravitational_parameter"]), hostile_numbers, max_size=2)
orbits = st.one_of(*[st.none()] * 4, *[good_orbits] * 3, hostile_orbits)


@st.composite
def options(draw, with_orbit):
    """Options of the command line that go together, with hostile numbers among them."""
    method = draw(st.sampled_from(METHODS))
    found = ["--method", method]
    usual = st.sampled_from(["0.01", "1", "3.5", "10"])
    numbers = usual | usual | hostile_numbers.map(repr)
    if draw(st.booleans()):
        return found
    if method.startswith("screw"):
        for name in draw(st.lists(st.sampled_from(["--lag", "--cutoff"]), max_size=2, unique=True)):
            found += [f"{name}={draw(numbers)}"]
        found += draw(st.sampled_from([[], [], ["--degree", "0"], ["--degree", "20"], ["--reference", "first"]]))
        found += ["--axes", "lvlh"] if with_orbit and draw(st.booleans()) else []
    else:
        paths = (
            ["fixed"]
            if method == "score"
            else ["fixed", "polynomial", "polynomial:1", "polynomial:20", "polynomial:" + "9" * 5000]
        )
        paths += ["relative-orbit"] if with_orbit and method != "score" else []
        if draw(st.booleans()):
            found += ["--trajectory", draw(st.sampled_from(paths))]
        if method != "score" and draw(st.integers(0, 3)) == 0:
            found += [f"--sigma={draw(numbers)}"]
        found += draw(st.sampled_from([[], ["--noise", "fixed"], ["--noise", "stereo"]])) if method != "score" else []
        found += draw(st.sampled_from([[], ["--torque", "none"]])) if method in ("ml", "ekf") else []
    return found


@st.composite
def commands(draw, texts):
    """Texts of a file of tracks and of an orbit, None for none, and the options: what a user may give to `estimate`."""
    orbit = draw(orbits)
    if orbit is not None:
        orbit = "\n".join(["[orbit]", *(f"{name} = {value!r}" for name, value in (GOOD_ORBIT | orbit).items())])
    return draw(texts), orbit, draw(options(orbit is not None))

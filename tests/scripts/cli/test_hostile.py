"""`estimate` with numbers that no mission has: exit 0 to 3, one line for a failure, bounded time, no warning."""

import json
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from guarded import Guarded
from hostile import commands, csv_of, hostile_tables, mangled, tables, tracks_files, tumbling

SECONDS = 120  # after which a command has hung; the slowest examples take some ten
SEPARATE = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
PROGRESS = re.compile(r"(reading|estimating by) .*: \d+\.\d\d s|  estimating by .*: \d+ %, about \d+ (s|min) left")
FORBIDDEN = "internal error", "Traceback", "arning", "On entry to"


@pytest.fixture(scope="module")
def guarded():
    process = Guarded()
    yield process
    process.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("hostile")


def run(guarded, folder, tracks, *options, orbit=None):
    """Exit code and the lines of an error, none for a result, checked as far as this holds for any input."""
    for path in folder.iterdir():
        path.unlink()
    (folder / "tracks.csv").write_bytes(tracks.encode("utf-8", "surrogatepass"))
    if orbit is not None:
        (folder / "orbit.toml").write_text(orbit, encoding="utf-8")
        options = (*options, "--orbit", str(folder / "orbit.toml"))
    code, out, err = guarded(["estimate", str(folder / "tracks.csv"), *options], SECONDS)
    for word in FORBIDDEN:
        assert word not in out + err
    complaints = [line for line in err.splitlines() if not PROGRESS.fullmatch(line)]
    written = {path.name for path in folder.iterdir()} - {"tracks.csv", "orbit.toml"}
    if code in (0, 3):
        assert complaints == []
        assert written == {"tracks.estimate.csv", "tracks.estimate.json", "tracks.estimate.report.html"}
        path = np.genfromtxt(folder / "tracks.estimate.csv", delimiter=",", skip_header=1, ndmin=2)
        assert np.isfinite(path[:, :4]).all()
    else:
        assert code in (1, 2), err
        assert len(complaints) == 1
        assert complaints[0].startswith("baryscope: ")
        assert written == set()
    return code, complaints


def flight(frames=30, features=5):
    time, position = tumbling(4, frames, features, 0.2)
    return time, position, np.tile(1e-4 * np.eye(3), (frames, features, 1, 1))


def spoilt(**changes):
    """The text of a file: time, position or covariance of a good flight, changed by a function."""
    parts = dict(zip(("time", "position", "covariance"), flight(), strict=True))
    for name, change in changes.items():
        parts[name] = parts[name].copy()
        parts[name] = change(parts[name])
    return csv_of(**parts)


def put(values, *place, value):
    values[place] = value
    return values


def late(values, gap):
    return values + np.where(np.arange(len(values)) < 15, 0.0, gap)


REFUSED = {
    "values of 1e150": (
        spoilt(position=lambda p: 1e150 * p),
        r"line 2, column x: .*e\+150, expected a number of met",
    ),
    "one coordinate of 1e160": (
        spoilt(position=lambda p: put(p, 7, 2, 1, value=1e160)),
        r"line 39, column y: 1e\+160, expected a number of metres within ±1e\+09",
    ),
    "one of the largest": (spoilt(position=lambda p: put(p, 7, 2, 1, value=1.7e308)), "column y: 1.7e"),
    "times of 1e300": (
        spoilt(time=lambda t: t + np.where(t > 5, 1e300 * (1 + t), 0)),
        r"line 32, column time: 7e\+300, expected a number of seconds within ±1e\+10",
    ),
    "a gap of 1e12 s": (
        spoilt(time=lambda t: late(t, 1e12)),
        r"line 77, column time: 1000000000015.0, expected a",
    ),
    "steps of 1e-300 s": (
        spoilt(time=lambda t: 1e-300 * t),
        r"tracks.csv: time goes from 0.0 to 1e-300, expected steps of at least 1e-06 s",
    ),
    "all in one place": (spoilt(position=lambda p: 1e-160 * p), "m apart, all in one place"),
    "a huge covariance": (
        spoilt(covariance=lambda c: 1e300 * c),
        r"column cxx: 1\.0\d*e\+296, expected a number of m²",
    ),
    "a covariance nearly of the largest": (
        spoilt(covariance=lambda c: put(c, 3, 1, 0, 0, value=1e308)),
        r"line 18, column cxx: 1e\+308",
    ),
}
UNUSABLE = {
    "ill-conditioned": (
        spoilt(covariance=lambda c: c @ np.diag([1.0, 1.0, 1e-13])),
        r"line 2: covariance of feature 'F0' at 0.0 s has standard deviations of 3.2e-09 to 0.01 m, "
        r"expected 1e-09 to .* a ratio of at most",
    ),
    "denormal": (spoilt(covariance=lambda c: 1e-316 * c), "'F0' at 0.0 s has standard deviations of .* expected 1e-09"),
    "one is zero": (
        spoilt(covariance=lambda c: put(c, 9, 3, value=0.0)),
        r"tracks\.csv, line 50: covariance of feature 'F3' at 9.0 s has standard deviations of 0",
    ),
    "all are zero": (spoilt(covariance=lambda c: 0 * c), r"tracks\.csv, line 2: .* standard deviations of 0 to 0 m"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_numbers_beyond_all_ranges_are_refused_by_line_and_column(case, guarded, folder):
    text, expected = REFUSED[case]
    code, (line,) = run(guarded, folder, text)
    assert code == 2
    assert re.search(expected, line)


@pytest.mark.parametrize("case", UNUSABLE)
@pytest.mark.parametrize("method", ["pivot", "ml", "ekf", "score"])
def test_covariances_that_have_no_sound_inverse_are_refused(case, method, guarded, folder):
    text, expected = UNUSABLE[case]
    code, (line,) = run(guarded, folder, text, "--method", method)
    assert code == 2
    assert re.search(expected, line)


TOO_OFTEN = r"turns at 0\.2\d* rad/s, .* times in the .* s of the tracks: too often for its motion"


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_a_gap_in_which_the_target_turns_too_often_to_be_followed(method, guarded, folder):
    """Work and memory of what follows the rotation grow with the gap: they give what `pivot` does."""
    tracks = spoilt(time=lambda t: late(t, 1e9))
    assert run(guarded, folder, tracks, "--method", method, "--trajectory", "polynomial:1")[0] in (0, 3)
    found = json.loads((folder / "tracks.estimate.json").read_text(encoding="utf-8"))
    (remark,) = [finding for finding in found["findings"] if finding["kind"] == "free-attitudes"]
    assert re.search(TOO_OFTEN, remark["reason"])


@pytest.mark.parametrize("gap", [1e5, 9e9])
def test_the_same_gap_and_a_method_that_follows_no_rotation(gap, guarded, folder):
    text = spoilt(time=lambda t: late(t, gap), covariance=lambda c: c)
    assert run(guarded, folder, text, "--trajectory", "polynomial:1")[0] in (0, 3)


@pytest.mark.parametrize("method, features", [("pivot", 1001), ("ml", 1001), ("ekf", 201)])
def test_more_features_than_a_method_can_take(method, features, guarded, folder):
    """Their time and memory grow with the square or the cube."""
    text = csv_of(*tumbling(4, 8, features, 0.2))
    code, (line,) = run(guarded, folder, text, "--method", method)
    assert code == 1
    assert re.search(rf"{features} features.* would take .*use at most (1000|200) ", line)


BEYOND = ["--sigma=1e-300", "--sigma=1e300", "--lag=1e-300", "--lag=1e300", "--cutoff=1e-300"]


@pytest.mark.parametrize("option", [*BEYOND, "--trajectory=polynomial:" + 5000 * "9"])
def test_options_beyond_all_ranges(option, guarded, folder):
    code, (line,) = run(guarded, folder, csv_of(*flight()), option)
    assert code == 2
    assert "expected" in line


def test_a_cutoff_lower_than_a_run_can_tell(guarded, folder):
    """The coefficients of such a filter vanish in rounding."""
    method = ["--method", "screw-gpa", "--lag", "3"]
    for cutoff in (1e-6, 1e-9):
        code, (line,) = run(guarded, folder, csv_of(*flight()), *method, f"--cutoff={cutoff}")
        assert code == 1
        assert "the axis of rotation does not turn visibly" in line


@settings(max_examples=75, suppress_health_check=SEPARATE)
@given(commands(tracks_files()))
def test_any_well_formed_tracks(guarded, folder, command):
    tracks, orbit, options = command
    run(guarded, folder, tracks, *options, orbit=orbit)


@settings(max_examples=50, suppress_health_check=SEPARATE)
@given(commands(tables | hostile_tables | mangled(tracks_files())))
def test_any_text(guarded, folder, command):
    tracks, orbit, options = command
    run(guarded, folder, tracks, *options, orbit=orbit)

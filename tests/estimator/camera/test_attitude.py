"""The camera's attitude from a file; the expected rotations are scipy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.rig import Rig
from baryscope.models.errors import InputError

TIME = np.arange(0.0, 61.0, 2.0)
TURN = Rotation.from_rotvec(
    np.column_stack([0.02 * TIME, 0.3 * np.sin(0.05 * TIME), -0.01 * TIME]) + np.array([2.5, 1.0, 0])
)
QUATERNION = np.roll(TURN.as_quat(), 1, axis=1)  # scalar first


def rows(time=TIME, quaternion=QUATERNION, header="time,qw,qx,qy,qz"):
    lines = [",".join(f"{value:.17g}" for value in (t, *q)) for t, q in zip(time, quaternion, strict=True)]
    return "\n".join([header, *lines]) + "\n"


def written(tmp_path, text):
    path = tmp_path / "attitude.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_interpolates_whatever_the_signs(tmp_path):
    signs = np.random.default_rng(1).choice([-1.0, 1.0], len(TIME))
    found = AttitudeSeries.read_csv(written(tmp_path, rows(quaternion=QUATERNION * signs[:, None])))
    between = np.sort(np.concatenate([TIME, np.random.default_rng(2).uniform(0, 60, 200)]))
    np.testing.assert_allclose(found.at(between), AttitudeSeries(TIME, QUATERNION).at(between), atol=1e-14)
    np.testing.assert_allclose(found.at(TIME), TURN.as_matrix(), atol=1e-14)


def even(time):
    """The rotations of an even turn."""
    return Rotation.from_rotvec(np.outer(time, [0.02, -0.01, 0.015])) * Rotation.from_rotvec([1.0, 0.5, -2.0])


def swing(time):
    """The rotations of swings of 3° and 2° in 60 s and 45 s beside a slow turn."""
    angles = np.deg2rad([3.0, 2.0]) * np.sin(2 * np.pi * np.asarray(time)[:, None] / [60.0, 45.0])
    turned = np.pad(angles, ((0, 0), (0, 1)))
    return Rotation.from_rotvec(np.outer(time, [0.0, 0.0, 1e-3])) * Rotation.from_rotvec(turned)


def series(time, turn):
    return AttitudeSeries(time, np.roll(turn.as_quat(), 1, axis=1))


@pytest.mark.parametrize("every", [1.0, 3.0])
def test_an_even_turn_is_slerp_at_any_times_of_the_rows(every):
    time = np.cumsum(every * np.random.default_rng(3).uniform(0.05, 1.0, 60))
    between = np.linspace(time[0], time[-1], 500)
    np.testing.assert_allclose(
        series(time, even(time)).at(between), Slerp(time, even(time))(between).as_matrix(), atol=1e-13
    )


def test_a_swing_is_followed_between_the_rows():
    """By a cubic of four rows, (3/128) h⁴ times the fourth derivative; at the ends of three, (1/16) h³ of the third.

    Along the great circle it is |dω/dt| h²/8 at most, 5e-4 to 1e-3 rad, in each turn of the swing the same.
    """
    time = np.arange(0.0, 301.0, 3.0)
    between = np.linspace(0.0, 300.0, 2001)

    def off(found):
        return (swing(between).inv() * Rotation.from_matrix(found)).magnitude()

    found, inner = off(series(time, swing(time)).at(between)), (between > 3.0) & (between < 297.0)
    n, size = 2 * np.pi / np.array([60.0, 45.0]), np.deg2rad([3.0, 2.0])
    assert found[inner].max() < 1.2 * 3 / 128 * 3.0**4 * float(np.linalg.norm(size * n**4))
    assert found.max() < 1.2 / 16 * 3.0**3 * float(np.linalg.norm(size * n**3))
    assert off(Slerp(time, swing(time))(between).as_matrix()).max() > 5e-4


def test_noise_of_rows_is_not_amplified_where_they_are_close():
    """Some rows have another 1 ms later, 1e-3 rad off: a rate between them would be a radian per second."""
    time = np.sort(np.concatenate([np.arange(0.0, 60.0, 3.0), np.arange(0.0, 60.0, 12.0) + 1e-3]))
    noise = 1e-3 * np.random.default_rng(4).standard_normal((len(time), 3))
    found = series(time, Rotation.from_rotvec(noise)).at(np.linspace(0.0, 57.0, 1000))
    # √(Σ w²) of the rows' weights w is 1 at a row, and hardly more between; of 3 · 25 numbers 4.5 deviations is none.
    assert Rotation.from_matrix(found).magnitude().max() < 4.5e-3


def test_rows_around_a_gap_tell_how_the_camera_turns_in_it():
    """Eight rows are missing; those half as far from it as it is long are taken, and not its neighbours alone."""
    time = np.arange(0.0, 301.0, 1.0)
    kept = (time <= 100.0) | (time >= 108.0)
    between = np.linspace(100.0, 108.0, 50)
    found = Rotation.from_matrix(series(time[kept], swing(time[kept])).at(between))
    along = Slerp(time[kept], swing(time[kept]))(between)
    off, of_slerp = ((swing(between).inv() * one).magnitude().max() for one in (found, along))
    assert off < 0.1 * of_slerp


def test_a_jump_of_the_attitude_is_none_of_a_swing():
    """Beyond 20° the rows on the other side tell nothing: on either side the camera is at rest."""
    time, angle = np.arange(20.0), np.where(np.arange(20.0) < 10, 0.0, 1.0)
    turn = Rotation.from_rotvec(np.outer(angle, [0.0, 1.0, 0.0]))
    between = np.concatenate([np.linspace(0.0, 9.0, 50), np.linspace(10.0, 19.0, 50)])
    expected = Rotation.from_rotvec(np.outer(np.where(between < 9.5, 0.0, 1.0), [0.0, 1.0, 0.0])).as_matrix()
    np.testing.assert_allclose(series(time, turn).at(between), expected, atol=1e-14)


def test_the_header_names_the_columns(tmp_path):
    text = rows(quaternion=np.roll(QUATERNION, -1, axis=1), header="time,qx,qy,qz,qw")
    found = AttitudeSeries.read_csv(written(tmp_path, text))
    np.testing.assert_allclose(found.at(TIME), TURN.as_matrix(), atol=1e-14)


def test_one_row_is_a_camera_that_does_not_turn(tmp_path):
    found = AttitudeSeries([0.0], QUATERNION[:1])
    np.testing.assert_allclose(found.at(np.zeros(1)), TURN[:1].as_matrix(), atol=1e-14)


def test_utc_times_are_those_of_the_tracks(tmp_path):
    stamps = [f"2020-02-29T23:59:{second:02d}Z" for second in range(0, 60, 2)]
    lines = [f"{t},{','.join(map(repr, q))}" for t, q in zip(stamps, QUATERNION[:30].tolist(), strict=True)]
    found = AttitudeSeries.read_csv(written(tmp_path, "\n".join(["time,qw,qx,qy,qz", *lines])))
    of_tracks = found.at(np.array([0.0, 3.0]), "2020-02-29T23:59:10Z")
    seconds = AttitudeSeries(TIME[:30], QUATERNION[:30]).at(np.array([10.0, 13.0]))
    np.testing.assert_allclose(of_tracks, seconds, atol=1e-14)
    with pytest.raises(InputError, match="UTC times of the attitude, but seconds of the tracks"):
        found.at(np.zeros(1))
    with pytest.raises(InputError, match="UTC times of the tracks, but seconds of the attitude"):
        AttitudeSeries(TIME, QUATERNION).at(np.zeros(1), "2020-02-29T23:59:10Z")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("time,qw", "time,w"), "unknown column 'w' in the header, expected time,qw,qx,qy,qz"),
        (lambda text: text.replace("\n4,", "\n1,"), r"line 4: time 1.0 after 2.0, expected strictly increasing times"),
        (lambda _: rows(quaternion=2 * QUATERNION), r"line 2: quaternion of length 2, expected 1"),
        (lambda text: text.rsplit(",", 1)[0] + ",\n", r"line 32: an empty cell, expected numbers of qw"),
        (lambda text: text.replace("\n6,", "\n2e10,"), r"line 5: time 20000000000.0, expected a number within ±1e\+10"),
    ],
)
def test_a_wrong_file_gets_one_line(tmp_path, change, message):
    path = written(tmp_path, change(rows()))
    with pytest.raises(InputError, match=message) as caught:
        AttitudeSeries.read_csv(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_times_outside_and_in_gaps_are_refused():
    whole = AttitudeSeries(TIME, QUATERNION)
    with pytest.raises(InputError, match=r"none for the time 60.5 s, expected rows that span it, found 0 to 60 s"):
        whole.at(np.array([1.0, 60.5]))
    kept = (TIME <= 10) | (TIME >= 32)
    gap = AttitudeSeries(TIME[kept], QUATERNION[kept])
    gap.at(np.array([9.0, 10.0, 32.0]))
    with pytest.raises(InputError, match=r"no row from 10 to 32 s, where there are tracks, expected .* at most 20 s"):
        gap.at(np.array([11.0]))


def test_refusals_tell_times_in_the_seconds_of_the_tracks():
    """Both were told as they are counted, so that second 1 was said not to be in 0 to 60."""
    kept = (TIME <= 10) | (TIME >= 32)
    gap = AttitudeSeries(TIME[kept], QUATERNION[kept], "2026-03-01T12:00:00Z")
    with pytest.raises(InputError, match=r"none for the time 1 s, expected rows that span it, found -60 to 0 s"):
        gap.at(np.array([0.0, 1.0]), "2026-03-01T12:01:00Z")
    with pytest.raises(InputError, match=r"no row from -50 to -28 s, where there are tracks"):
        gap.at(np.array([-30.0]), "2026-03-01T12:01:00Z")


def test_too_wide_a_turn_is_not_interpolated():
    wide = AttitudeSeries([0.0, 1.0], [[1, 0, 0, 0], [np.cos(0.1), np.sin(0.1), 0, 0]])
    wide.at(np.array([0.0, 1.0]))
    with pytest.raises(InputError, match=r"turns by 11.5° from 0 to 1 s, expected at most 10°"):
        wide.at(np.array([0.5]))


def test_shapes_are_checked():
    with pytest.raises(InputError, match=r"time has the shape \(31,\) and quaternion \(31, 3\)"):
        AttitudeSeries(TIME, QUATERNION[:, :3])


def test_a_camera_is_of_series_and_rig_and_of_no_names_of_files():
    series = AttitudeSeries(TIME, QUATERNION)
    with pytest.raises(
        InputError, match=r"^camera's attitude: found str, expected AttitudeSeries, .*Camera.load reads"
    ):
        Camera("attitude.csv", Rig())
    with pytest.raises(InputError, match=r"^camera's rig: found str, expected Rig, .*Camera.load reads"):
        Camera(series, "rig.toml")


def test_what_becomes_of_the_arrays_that_made_it_changes_no_series():
    time, quaternion = np.arange(2.0), np.array([[1.0, 0, 0, 0]] * 2)
    series = AttitudeSeries(time, quaternion)
    time[:] = quaternion[:] = -9.0
    np.testing.assert_array_equal(series.time, [0, 1])
    np.testing.assert_array_equal(series.quaternion, [[1, 0, 0, 0]] * 2)

"""The chaser's known acceleration: held, turned, and refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.tables.acceleration import read_acceleration
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit

ORBIT = Orbit(7.1e6, 0.01, 1.0, 0.3, 0.4, 0.5)


def test_each_row_is_held_until_the_next():
    known = KnownAcceleration([0.0, 10.0, 20.0], [[1, 2, 3], [1, 2, 3], [0, 0, 1]])
    found = known.inertial(np.array([-0.1, 0.0, 10.0, 19.9, 20.0, 1e6]), None)
    np.testing.assert_array_equal(found, [[0, 0, 0], [1, 2, 3], [1, 2, 3], [1, 2, 3], [0, 0, 1], [0, 0, 1]])
    np.testing.assert_array_equal(known.time, [0, 20])  # where it changes


def test_axes():
    time = np.array([5.0, 1500.0])
    lvlh = KnownAcceleration([0.0], [[0.1, 0.2, 0.3]], "lvlh").inertial(time, ORBIT)
    np.testing.assert_allclose(lvlh, lvlh_attitude(ORBIT, time) @ [0.1, 0.2, 0.3], atol=1e-12)

    def attitude(t):
        return Rotation.from_rotvec(t[:, None] * [0.0, 0.0, 0.01]).as_matrix()

    camera = KnownAcceleration([0.0], [[1.0, 0, 0]], "camera", attitude=attitude)
    np.testing.assert_allclose(camera.inertial(time, None)[0], [np.cos(0.05), np.sin(0.05), 0], atol=1e-12)
    # Without thrust the attitude is not asked for, which may be unknown then.
    late = KnownAcceleration([10.0, 20.0], [[1.0, 0, 0], [0, 0, 0]], "camera", attitude=attitude)
    np.testing.assert_array_equal(late.inertial(np.array([5.0, 30.0]), None), np.zeros((2, 3)))
    # 0.2 rad at 0.01 rad/s; the attitude is looked at often enough
    assert camera.smooth_for(0.0, 1000.0) == pytest.approx(20.0, rel=1e-6)
    with pytest.raises(InputError, match="axes are lvlh, which need the target's orbit"):
        KnownAcceleration([0.0], [[0.1, 0.2, 0.3]], "lvlh").inertial(time, None)


def test_an_attitude_is_asked_for_under_thrust_only():
    """A camera of whose attitude nothing is known but while the thrusters fire: twice, at two rates."""

    def attitude(t):
        first, second = (t >= 10) & (t <= 20), (t >= 600) & (t <= 601)
        assert (first | second).all()
        angle = np.where(first, 0.01 * t, 0.04 * t)
        return Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0]).as_matrix()

    rows = [[1.0, 0, 0], [0, 0, 0], [0, 1.0, 0], [0, 0, 0]]
    known = KnownAcceleration([10.0, 20.0, 600.0, 601.0], rows, "camera", attitude=attitude)
    assert known.smooth_for(0.0, 500.0) == pytest.approx(20.0, rel=1e-6)
    assert known.smooth_for(-1e4, 1e4) == pytest.approx(5.0, rel=1e-6)  # 0.2 rad at 0.04 rad/s
    assert known.smooth_for(30.0, 500.0) == np.inf
    assert KnownAcceleration([0.0], [[1.0, 0, 0]], "inertial", attitude=attitude).smooth_for(0.0, 1e3) == np.inf


def test_firings_end_with_a_zero():
    value = np.zeros((8, 3))
    value[[1, 2, 4, 7], 0] = [1.0, 2.0, 3.0, 4.0]
    known = KnownAcceleration(np.arange(8.0), value)
    np.testing.assert_array_equal(known.time, [0, 1, 2, 3, 4, 5, 7])
    np.testing.assert_array_equal(known.firings(-1.0, 100.0), [-1, 0, 0, -1, 1, -1, 2])
    np.testing.assert_array_equal(known.firings(2.5, 7.0), [-1, 0, 0, -1, 1, -1, -1])  # all of the first one's values
    np.testing.assert_array_equal(known.firings(5.0, 6.0), [-1] * 7)
    np.testing.assert_array_equal(known.besides(2.5, 7.0).inertial(np.arange(8.0), None)[:, 0], [0] * 7 + [4.0])
    many = KnownAcceleration(np.arange(200.0), np.tile([[1.0, 0, 0], [0, 0, 0]], (100, 1)))
    found = many.firings(0.0, 200.0)
    assert (found[::2].min(), found[::2].max(), np.unique(found[::2]).size) == (0, 31, 32)
    assert (found[1::2] == -1).all()


@pytest.mark.parametrize(
    ("arguments", "keywords", "expected"),
    [
        (([0.0], [1.0, 2, 3]), {}, r"shape \(1,\) and value \(3,\), expected \(k,\) and \(k, 3\)"),
        (([0.0, 0.0], np.ones((2, 3))), {}, "times that do not ascend"),
        (([np.nan], np.ones((1, 3))), {}, "times that do not ascend"),
        (([0.0], [[1e4, 0, 0]]), {}, r"\[10000.0, 0.0, 0.0\] at 0.0 s, expected within ±1000 m/s²"),
        (([0.0], np.ones((1, 3)), "body"), {}, "axes are 'body', expected inertial, lvlh or camera"),
        (([0.0], np.ones((1, 3)), "camera"), {}, "needs the camera's attitude"),
        (([0.0], np.ones((1, 3))), {"scale": -0.1}, "scale is -0.1, expected 0 to 1"),
        (([0.0], np.ones((1, 3))), {"firing": 2.0}, "firing is 2.0, expected 0 to 1"),
        (([0.0], np.ones((1, 3))), {"noise": np.nan}, "noise is nan, expected 0 to 1000"),
        (([0.0], np.ones((1, 3))), {"noise": "1e-9"}, "noise is '1e-9', expected 0 to 1000"),
        ((np.arange(2e5), np.arange(6e5).reshape(-1, 3) % 7), {}, "changes 200000 times, expected at most 100000"),
    ],
)
def test_what_is_no_acceleration_is_refused(arguments, keywords, expected):
    with pytest.raises(InputError, match=expected) as caught:
        KnownAcceleration(*arguments, **keywords)
    assert "\n" not in str(caught.value)


def test_a_file(tmp_path):
    path = tmp_path / "thrust.csv"
    path.write_text("time,ax,ay,az\n0,1e-3,0,0\n5.5,0,-2e-3,0\n", encoding="utf-8")
    time, value = read_acceleration(path)
    np.testing.assert_array_equal(time, [0, 5.5])
    np.testing.assert_array_equal(value, [[1e-3, 0, 0], [0, -2e-3, 0]])
    path.write_text("time,ax,ay,az\n2026-03-01T12:00:10Z,1,2,3\n2026-03-01T12:00:11Z,1,2,3\n", encoding="utf-8")
    np.testing.assert_array_equal(read_acceleration(path, "2026-03-01T12:00:00Z")[0], [10, 11])


BAD = {
    "header": ("time,ax,ay\n", "column 'az' is missing from the header, expected time,ax,ay,az$"),
    "unit": ("time,ax_mm,ay,az\n", "unknown column 'ax_mm' in the header, expected time,ax,ay,az$"),
    "rows": ("time,ax,ay,az\n", "no rows below the header"),
    "cell": ("time,ax,ay,az\n0,1,2,fast\n", "line 2, column az: 'fast', expected a finite number"),
    "empty": ("time,ax,ay,az\n0,1,2,3\n1,1,,3\n", "line 3, column ay: missing, expected a number within ±1000 m/s²"),
    "order": ("time,ax,ay,az\n1,1,2,3\n0,1,2,3\n", "line 3, column time: not after the row before"),
    "large": ("time,ax,ay,az\n1,1,2,3000\n", "line 2, column az: 3000.0, expected a number within"),
    "utc": ("time,ax,ay,az\n2026-03-01T12:00:00Z,1,2,3\n", "UTC times, expected seconds, as in the tracks"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_in_one_line(tmp_path, name):
    text, expected = BAD[name]
    path = tmp_path / "thrust.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=expected) as caught:
        read_acceleration(path)
    assert str(caught.value).startswith(str(path))

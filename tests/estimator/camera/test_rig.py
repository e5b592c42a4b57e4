"""Rig files."""

import numpy as np
import pytest

from baryscope.estimator.camera.rig import Rig, load_rig
from baryscope.models.errors import InputError

WHOLE = """
[rig]
lever_arm = [1.0, 0.5, -0.25]
lever_arm_axes = "chaser"
mounting = [0.0, 1.0, 0.0, 0.0]
lever_arm_deviation = [0.01, 0.01, 0.02]
boresight_deviation = 1e-3
scale_deviation = 1e-4
attitude_noise = 0
"""


def written(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_whole_file(tmp_path):
    found = load_rig(written(tmp_path, WHOLE))
    assert found == Rig((1.0, 0.5, -0.25), "chaser", (0, 1, 0, 0), (0.01, 0.01, 0.02), 1e-3, 1e-4)
    assert found.boresight_deviation == (1e-3,) * 3
    assert load_rig(written(tmp_path, "[rig]\n")) == Rig()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[rig]\nlever_arm = [1, 2]", r"rig.lever_arm: found a list of 2, expected a list of 3 numbers in m"),
        ("[rig]\nlever_arm = [800, -300, 50]", r"rig.lever_arm\[0\]: found 800, expected a value of at most 100 in m"),
        ("[rig]\nboresight_deviation = 1.0", r"rig.boresight_deviation.*expected a value of at most 0.2"),
        ("[rig]\nscale_deviation = -1e-3", r"rig.scale_deviation: found -0.001, expected a value of at least 0"),
        ("[rig]\nscale = 1e-3", r"rig.scale: unknown field"),
        ('[rig]\nlever_arm_axes = "chaser"', r"rig.mounting: missing, expected a quaternion"),
        ("[rig]\nmounting = [0, 1.0, 0, 0]", r"rig.mounting: found beside a lever arm in camera axes"),
        ("[rig]\nmounting = [1, 1.0, 0, 0]", r"rig.mounting: found a quaternion .* of length 1.41421, expected 1"),
        ("lever_arm = [1, 2, 3]", r"lever_arm: unknown field, expected rig"),
    ],
)
def test_a_wrong_file_gets_one_line(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        load_rig(path)
    assert str(caught.value).startswith(str(path))


def test_values_in_python_are_checked():
    assert Rig(lever_arm=np.array([1, 2, 3]), attitude_noise=np.float64(1e-4)).attitude_noise == (1e-4,) * 3
    assert Rig(boresight_deviation=np.array(1e-3)).boresight_deviation == (1e-3,) * 3
    expected = "expected a list of 3 numbers in m$"
    for arm, found in ((np.array(1.0), "1.0"), (1.0, "1.0"), (np.ones(2), "a list of 2"), (None, "None")):
        with pytest.raises(InputError, match=rf"^rig: rig.lever_arm: found {found}, {expected}"):
            Rig(lever_arm=arm)
    for arm in (np.eye(3), ["a", "b", "c"], np.array(["a", "b", "c"])):
        with pytest.raises(InputError, match=r"^rig: rig.lever_arm\[0\]: found [^\n]*, expected a number in m"):
            Rig(lever_arm=arm)
    with pytest.raises(InputError, match=r"rig: rig.scale_deviation: found 2.0"):
        Rig(scale_deviation=2.0)
    with pytest.raises(InputError, match=r"rig: rig.mounting: found beside a lever arm in camera axes"):
        Rig((1.0, 0.0, 0.0), mounting=(0.0, 1.0, 0.0, 0.0))

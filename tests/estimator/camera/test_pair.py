"""The lenses of a stereo pair in a rig file."""

import numpy as np
import pytest

from baryscope.estimator.camera.rig import Rig, load_pair, load_rig
from baryscope.models.errors import InputError

LENS = "focal_length = 800\nprincipal_point = [319.5, 239.5]\nresolution = [640, 480]\n"
HEAD = "[rig]\nlever_arm = [1.0, 0.5, -0.25]\n"
LEFT = f"[rig.left]\n{LENS}distortion = [-0.1, 0.02, 0.0, 0.0, 0.0]\n"
RIGHT = f"[rig.right]\n{LENS}position = [0.3, 0.01, 0.0]\nmounting = [1, 0, 0.02, 0]\n"


def written(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_pair_beside_the_rig(tmp_path):
    path = written(tmp_path, HEAD + LEFT + RIGHT)
    pair = load_pair(path)
    np.testing.assert_array_equal(pair.left.matrix, [[800, 0, 319.5], [0, 800, 239.5], [0, 0, 1]])
    assert pair.left.distortion[0] == -0.1
    assert pair.right.distortion == ()
    angle = 2 * np.arctan(0.02)  # of a quaternion (1, 0, 0.02, 0), about y
    np.testing.assert_allclose(pair.R_left_right[:, 2], [np.sin(angle), 0, np.cos(angle)], atol=1e-15)
    assert load_rig(path) == Rig((1.0, 0.5, -0.25))  # what `baryscope estimate` reads of the same file


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD, r"rig.left: missing, expected a table with focal_length"),
        (LEFT, r"rig.right: missing"),
        (LEFT + RIGHT.replace("800", "-800"), r"rig.right.focal_length\[0\]: found -800.0, expected a value of"),
        (LEFT + RIGHT.replace("0.3", "-0.3"), r"rig.right.position: found \[-0.3, 0.01, 0\] m, expected"),
        (LEFT + RIGHT.replace("0.01", "0.2"), r"rig.right.position: found \[0.3, 0.2, 0\] m, .* at most 0.5 x"),
        (LEFT + RIGHT.replace("640", "600"), r"found images of 640×480 and 600×480 px, expected two of one size"),
        (LEFT.replace(", 0.0]", "]") + "k = 3\n" + RIGHT, r"rig.left.k: unknown field"),
        (LEFT.replace("0.02, 0.0, ", "") + RIGHT, r"rig.left.distortion: found 3 coefficients, expected 4, 5, 8"),
        (LEFT + RIGHT.replace("mounting = [1,", "mounting = [2,"), r"rig.right.mounting: found a quaternion .* 2.0001"),
    ],
)  # fmt: skip
def test_a_wrong_pair_gets_one_line(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        load_pair(path)
    assert str(caught.value).startswith(str(path))

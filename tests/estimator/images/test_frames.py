"""Images from folders and videos."""

import numpy as np
import pytest

from baryscope.estimator.images.frames import frames_of, pairs_of
from baryscope.models.errors import InputError

cv2 = pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")

GREY = np.full((48, 64), 100, np.uint8)


def folder(path, names, value=0):
    path.mkdir()
    for name in names:
        cv2.imwrite(str(path / name), GREY + value)
    return path


def test_a_folder_is_read_in_the_order_of_its_numbers(tmp_path):
    names = ["f9.png", "f10.png", "f2.bmp"]
    path = folder(tmp_path / "left", names)
    (path / "notes.txt").write_text("no image", encoding="utf-8")
    found = frames_of(path)
    assert (len(found), found.rate) == (3, None)
    assert [name.rpartition("/")[2] for name, _ in found] == ["f2.bmp", "f9.png", "f10.png"]
    assert all((image == GREY).all() for _, image in found)


def test_a_video_tells_its_rate(tmp_path):
    path = tmp_path / "left.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 12.5, (64, 48))
    for value in range(5):
        writer.write(cv2.cvtColor(GREY + 20 * np.uint8(value), cv2.COLOR_GRAY2BGR))
    writer.release()
    found = frames_of(path)
    assert (len(found), found.rate) == (5, 12.5)
    assert [round(float(image.mean())) for _, image in found] == pytest.approx([100, 120, 140, 160, 180], abs=2)


def test_what_cannot_be_read_is_one_line(tmp_path):
    left = folder(tmp_path / "left", ["0.png", "1.png"])
    empty = folder(tmp_path / "empty", [])
    one = folder(tmp_path / "one", ["0.png"])
    broken = folder(tmp_path / "broken", ["0.png"])
    (broken / "1.png").write_bytes(b"no image")
    text = tmp_path / "video.avi"
    text.write_text("no video", encoding="utf-8")
    for path, words in (
        (empty, "no images"),
        (tmp_path / "none", "not found"),
        (text, "cannot be read, expected a video"),
    ):
        with pytest.raises(InputError, match=words) as caught:
            frames_of(path)
        assert str(caught.value).startswith(str(path))
    for others, size, words in (
        (one, (64, 48), "one: 1 images, but .*left has more"),
        (broken, (64, 48), "1.png: cannot be decoded"),
        (left, (64, 40), "0.png: 64×48 px, expected 64×40, the rig's resolution"),
    ):
        with pytest.raises(InputError, match=words):
            list(pairs_of(frames_of(left), frames_of(others), size))

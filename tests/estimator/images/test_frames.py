"""Images from folders and videos."""

import numpy as np
import pytest

from baryscope.estimator.images.frames import frames_of, pairs_of
from baryscope.models.errors import InputError
from pictures import video

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
    found = frames_of(video(tmp_path / "left.avi", 12.5, [100, 120, 140, 160, 180]))
    assert (len(found), found.rate) == (5, 12.5)
    assert [round(float(image.mean())) for _, image in found] == pytest.approx([100, 120, 140, 160, 180], abs=2)


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_grey_values_of_more_bits_than_8(tmp_path, bits):
    """As cameras of 10 and 12 bits store them, in the lower bits of 16: four of the grey values were left, or 16."""
    steps = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64) % 256
    for name, values in (("0.png", steps // 4), ("1.png", steps)):  # what is dark at first is not made brighter
        cv2.imwrite(str(tmp_path / name), values.astype(np.uint16) << (bits - 8))
    found = [image for _, image in frames_of(tmp_path)]
    assert [image.dtype for image in found] == [np.uint8, np.uint8]
    np.testing.assert_array_equal(found, [steps // 4, steps])


def test_grey_values_that_are_no_whole_numbers_are_refused(tmp_path, capfd):
    cv2.imwrite(str(tmp_path / "0.tiff"), GREY.astype(np.float32) / 255)
    with pytest.raises(InputError, match=r"0.tiff: found grey values of type float32, expected whole numbers of 8 or"):
        list(frames_of(tmp_path))
    (tmp_path / "0.tiff").write_bytes((tmp_path / "0.tiff").read_bytes()[:200])
    with pytest.raises(InputError, match=r"0.tiff: cannot be decoded"):
        list(frames_of(tmp_path))
    assert not capfd.readouterr().err  # OpenCV has remarks of its own


def test_what_cannot_be_read_is_one_line(tmp_path):
    left = folder(tmp_path / "left", ["0.png", "1.png"])
    empty = folder(tmp_path / "empty", [])
    one = folder(tmp_path / "one", ["0.png"])
    film = video(tmp_path / "film.avi", 12.5, [100])
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
        (one, (64, 48), "one: 1 image, but .*left has more"),
        (film, (64, 48), r"film.avi: 1 image, but .*left has more"),
        (broken, (64, 48), "1.png: cannot be decoded"),
        (left, (64, 40), "0.png: 64×48 px, expected 64×40, the rig's resolution"),
    ):
        with pytest.raises(InputError, match=words):
            list(pairs_of(frames_of(left), frames_of(others), size))

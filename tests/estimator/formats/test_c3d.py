"""Tracks from C3D files, as ezc3d writes them and as other recorders do."""

import struct
from contextlib import suppress

import ezc3d
import numpy as np
import pytest

from baryscope.estimator import FeatureTracks, read_tracks
from baryscope.estimator.formats import METRES
from baryscope.models.errors import InputError
from recorded import TIME, same


def c3d(tracks, path, unit="mm", labels=True):
    """As ezc3d writes it, in single precision."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [2.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit] if unit else []
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(tracks.labels) if labels else ()
    points = np.ones((4, len(tracks.labels), len(tracks.time)))
    points[:3] = np.moveaxis(tracks.position, -1, 0).swapaxes(1, 2) / METRES[unit or "m"]
    file["data"]["points"] = points
    file.write(str(path))


def test_c3d_has_its_own_unit(tracks, tmp_path):
    c3d(tracks, tmp_path / "t.c3d")
    same(read_tracks(tmp_path / "t.c3d"), tracks, rtol=1e-6)
    np.testing.assert_allclose(read_tracks(tmp_path / "t.c3d", "m").position, 1e3 * tracks.position, rtol=1e-6)


def test_more_markers_than_a_list_of_labels_holds(tmp_path):
    many = FeatureTracks(TIME[:3], np.random.default_rng(1).normal(size=(3, 300, 3)), [f"M{k}" for k in range(300)])
    c3d(many, tmp_path / "t.c3d")
    same(read_tracks(tmp_path / "t.c3d"), many, rtol=1e-6)


def told_by_trial(file, frames):
    file.add_parameter("TRIAL", "ACTUAL_START_FIELD", [1, 0])
    file.add_parameter("TRIAL", "ACTUAL_END_FIELD", [frames & 0xFFFF, frames >> 16])


@pytest.mark.parametrize("tell", [
    lambda file, frames: None, told_by_trial, lambda file, frames: file.add_parameter("POINT", "LONG_FRAMES", [frames])
])  # fmt: skip
def test_more_frames_than_the_header_of_a_c3d_file_counts(tmp_path, tell):
    """Ten minutes at 120 Hz: ezc3d writes them all, and reads 65,535. The last is zero, and there where it is told."""
    frames, file = 72_001, ezc3d.c3d()
    points = np.ones((4, 3, frames))
    points[:3] = np.random.default_rng(1).normal(size=(3, 3, frames)).astype(np.float32)
    points[0, 1, 70_000] = np.nan
    points[:3, :, -1] = 0.0
    file["parameters"]["POINT"]["RATE"]["value"] = [120.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    file["parameters"]["POINT"]["LABELS"]["value"] = ("a", "b", "c")
    file["data"]["points"] = points
    tell(file, frames)
    file.write(str(tmp_path / "t.c3d"))
    found = read_tracks(tmp_path / "t.c3d")
    told = frames if file["parameters"].get("TRIAL") or "LONG_FRAMES" in file["parameters"]["POINT"] else frames - 1
    assert len(found.time) == told
    assert found.time[-1] == (told - 1) / 120.0
    assert np.argwhere(~found.seen).tolist() == [[70_000, 1]]
    expected = np.where(found.seen[..., None], np.moveaxis(points[:3, :, :told], 0, -1).swapaxes(0, 1), np.nan)
    np.testing.assert_array_equal(found.position, expected)


@pytest.mark.parametrize("kept", [0, 100, 511, 512, 700, 1024, 1600])
def test_a_c3d_file_that_is_cut_short_is_refused(tracks, tmp_path, kept):
    c3d(tracks, tmp_path / "t.c3d")
    content = (tmp_path / "t.c3d").read_bytes()
    assert len(content) > 1600
    (tmp_path / "t.c3d").write_bytes(content[:kept])
    with pytest.raises(InputError, match=r"t\.c3d: "):
        read_tracks(tmp_path / "t.c3d")


def test_the_unit_is_told_by_the_file_or_by_hand(tracks, tmp_path):
    """Millimetres of a file without a unit passed for metres."""
    c3d(tracks, tmp_path / "t.c3d", unit="")
    with pytest.raises(InputError, match=r"t\.c3d: tells no unit of lengths, expected one to be told: --units mm"):
        read_tracks(tmp_path / "t.c3d")
    same(read_tracks(tmp_path / "t.c3d", "m"), tracks, rtol=1e-6)


def test_markers_that_share_a_label_are_told_apart_by_their_numbers(tmp_path):
    """Unnamed trajectories are called * by some recorders: the whole file was refused."""
    times, points = TIME[:3], np.random.default_rng(1).normal(size=(3, 4, 3))
    made = FeatureTracks(times, points, ["*", "LASI", "x", "RASI"])
    file = ezc3d.c3d()
    c3d(made, tmp_path / "t.c3d")
    file = ezc3d.c3d(str(tmp_path / "t.c3d"))
    file["parameters"]["POINT"]["LABELS"]["value"] = ("*", "LASI", "*", "RASI")
    file.write(str(tmp_path / "t.c3d"))
    assert read_tracks(tmp_path / "t.c3d").labels == ("* 1", "LASI", "* 3", "RASI")


@pytest.mark.parametrize("group", ["ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS"])
def test_outputs_of_a_model_are_no_markers(tracks, tmp_path, group):
    """Vicon Nexus keeps joint angles and the like among the points, as does `group` tell: degrees passed for mm."""
    labels, outputs = list(tracks.labels), ["RKneeAngles", "*"]
    degrees = 30 * np.random.default_rng(3).normal(size=(len(tracks.time), 2, 3)) * METRES["mm"]
    mixed = np.concatenate([degrees[:, :1], tracks.position, degrees[:, 1:]], axis=1)
    c3d(FeatureTracks(tracks.time, mixed, [outputs[0], *labels, outputs[1]]), tmp_path / "t.c3d")
    same(read_tracks(tmp_path / "t.c3d").of_features(labels), tracks, rtol=1e-6)
    file = ezc3d.c3d(str(tmp_path / "t.c3d"))
    file.add_parameter("POINT", group, outputs)
    file.write(str(tmp_path / "t.c3d"))
    same(read_tracks(tmp_path / "t.c3d"), tracks, rtol=1e-6)
    file.add_parameter("POINT", group, [outputs[0], *labels, outputs[1]])
    file.write(str(tmp_path / "t.c3d"))
    with pytest.raises(InputError, match=r"t\.c3d: no markers, only outputs of a model as 'RKneeAngles', expected"):
        read_tracks(tmp_path / "t.c3d")


INTEL, DEC, MIPS = 84, 85, 86


def words(order, kind, values):
    return struct.pack(f"{order}{len(values)}{kind}", *values)


def by_hand(processor, scale, points, valid, ends=(1, None), labels=b"A B ", more=()):
    """A file by the manual: header, parameters of one block, and frames, of 16 bits where scale is positive."""
    order = ">" if processor == MIPS else "<"

    def floats(*values):
        if processor != DEC:
            return words(order, "f", values)
        bits = np.array(values, dtype="<f4") * 4
        return bits.astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1].tobytes()

    def parameter(name, kind, shape, content, group=1):
        body = struct.pack("bB", kind, len(shape)) + bytes(shape) + content + b"\0"
        return struct.pack("bb", len(name), group) + name + words(order, "h", [2 + len(body)]) + body

    n, m = valid.shape
    first, last = ends
    parameters = [
        parameter(b"RATE", 4, [], floats(50.0)),
        parameter(b"UNITS", -1, [4], b"mm  "),
        parameter(b"LABELS", -1, [2, m], labels),
        *(parameter(name, 2, [2], words(order, "H", [value & 0xFFFF, value >> 16]), 2) for name, value in more),
        struct.pack("bb", 5, -2) + b"TRIAL" + words(order, "h", [3]) + b"\0",
        struct.pack("bb", 5, -1) + b"POINT" + words(order, "h", [3]) + b"\0",  # groups may come last
        b"\0\0",
    ]
    head = bytes([2, 0x50]) + words(order, "H", [m, 1, first, last or first + n - 1, 10])
    head += floats(scale) + words(order, "H", [3, 1]) + floats(50.0)
    content = head.ljust(512, b"\0") + (bytes([1, 80, 1, processor]) + b"".join(parameters)).ljust(512, b"\0")
    seen = np.where(valid, 0.0, -1.0)[..., None]
    if scale < 0:
        rows = np.concatenate([points, seen], axis=2).reshape(n, 4 * m)
        return content + floats(*np.column_stack([rows, np.full(n, 0.5)]).ravel())
    rows = np.concatenate([(points / scale).astype(int), seen], axis=2).reshape(n, 4 * m)
    return content + np.column_stack([rows, np.full(n, 7)]).astype(order + "i2").tobytes()


@pytest.mark.parametrize("scale", [-1.0, 0.5])
@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
def test_files_of_all_processors_with_integers_and_floats(tmp_path, processor, scale):
    """The numbers are those of the manual's forms, written here; ezc3d refuses MIPS."""
    points = np.random.default_rng(3).integers(-900, 900, (5, 2, 3)).astype(float)
    valid = np.ones((5, 2), dtype=bool)
    valid[1, 1] = False
    (tmp_path / "t.c3d").write_bytes(by_hand(processor, scale, points, valid, (11, None)))
    found = read_tracks(tmp_path / "t.c3d")
    assert found.labels == ("A", "B")
    assert found.time.tolist() == [0.2, 0.22, 0.24, 0.26, 0.28]
    np.testing.assert_array_equal(found.seen, valid)
    np.testing.assert_allclose(found.position[valid], 1e-3 * points[valid], rtol=1e-12)


def test_labels_beyond_ascii(tmp_path):
    """In Latin 1, as of old recorders, or UTF-8, as of new ones."""
    for label in (b"\xc9 ", "É".encode()):
        content = by_hand(INTEL, -1.0, np.ones((5, 2, 3)), np.ones((5, 2), dtype=bool), labels=b"A " + label)
        (tmp_path / "t.c3d").write_bytes(content)
        assert read_tracks(tmp_path / "t.c3d").labels == ("A", "É")


def test_no_damage_is_more_than_an_error(tracks, tmp_path):
    """ezc3d ended the whole process, or read for ever, in one of thirty files with a few wrong bytes."""
    c3d(tracks, tmp_path / "t.c3d")
    content, rng = (tmp_path / "t.c3d").read_bytes(), np.random.default_rng(1)
    for _ in range(400):
        damaged = np.frombuffer(content, np.uint8).copy()
        damaged[rng.integers(2048, size=3)] = rng.integers(256, size=3)
        (tmp_path / "d.c3d").write_bytes(damaged)
        with suppress(InputError):
            read_tracks(tmp_path / "d.c3d")


def test_a_long_recording_that_begins_late_is_whole(tmp_path):
    """The header counts to 65,535, and ezc3d reads no further than that from a first frame of 101."""
    frames = 66_000
    points, valid = np.ones((frames, 2, 3)), np.ones((frames, 2), dtype=bool)
    points[:, 0, 0] = np.arange(frames) % 1000
    content = by_hand(INTEL, 0.5, points, valid, (101, 0xFFFF))
    (tmp_path / "t.c3d").write_bytes(content)
    found = read_tracks(tmp_path / "t.c3d")
    assert len(found.time) == frames
    assert found.time[0] == 2.0
    np.testing.assert_allclose(found.position[:, 0, 0], 1e-3 * points[:, 0, 0])


@pytest.mark.parametrize("begin, told, kept, first", [(1, 66_000, 66_000, 0), (70_001, 5, 5, 70_000), (1, 9, 5, 10)])
def test_frames_beyond_16_bits_that_the_header_has_cut(tmp_path, begin, told, kept, first):
    """Some recorders keep what is left of 16 bits, where 66,000 frames pass for 464: the rest was lost without a word.

    Parameters that tell of more frames than the file has are those of the recording it was cut out of.
    """
    points, valid = np.ones((kept, 2, 3)), np.ones((kept, 2), dtype=bool)
    of_header = 11 if told > kept else begin & 0xFFFF
    last = (of_header + min(told, kept) - 1) & 0xFFFF
    more = [(b"ACTUAL_START_FIELD", begin), (b"ACTUAL_END_FIELD", begin + told - 1)]
    (tmp_path / "t.c3d").write_bytes(by_hand(INTEL, 0.5, points, valid, (of_header, last), more=more))
    found = read_tracks(tmp_path / "t.c3d")
    assert len(found.time) == kept
    assert found.time[0] == first / 50.0

"""TRC files: tracks as motion capture has them; what is none is refused in a line."""

import io

import numpy as np
import pytest

from baryscope.estimator import FeatureTracks, read_tracks
from baryscope.estimator.formats import METRES, write_trc
from baryscope.models.errors import InputError
from recorded import TIME, same, trc


def test_trc_is_written_as_motion_capture_has_it(tracks, precise, tmp_path):
    """Cell by cell what `trc` writes, numbers to the digits of µm; what the form has no place for is refused."""
    with (tmp_path / "t.trc").open("w", encoding="utf-8") as stream:
        write_trc(tracks, "t.trc", stream)
    same(read_tracks(tmp_path / "t.trc"), tracks)
    ours, expected = ([line.split("\t") for line in text.splitlines()] for text in (
        (tmp_path / "t.trc").read_text(encoding="utf-8"), trc(tracks)))  # fmt: skip
    assert [ours[0], ours[1], ours[3], ours[4], ours[5]] == [expected[k] for k in (0, 1, 3, 4, 5)]
    for row, other in zip([ours[2], *ours[6:]], [expected[2], *expected[6:]], strict=True):
        assert [cell if cell in ("", "mm") else pytest.approx(float(cell), abs=1e-3) for cell in row] == [
            cell if cell in ("", "mm") else float(cell) for cell in other
        ]
    with pytest.raises(InputError, match=r"p\.trc: found tracks with covariances, for which TRC has no place"):
        write_trc(precise, "p.trc", io.StringIO())
    with pytest.raises(InputError, match=r"l\.trc: found the label 'a\\tb', expected one without tabs"):
        write_trc(FeatureTracks(TIME[:1], np.zeros((1, 1, 3)), ["a\tb"]), "l.trc", io.StringIO())


@pytest.mark.parametrize("unit", ["mm", "m", "cm"])
def test_trc_has_its_own_unit(tracks, tmp_path, unit):
    (tmp_path / "t.trc").write_text(trc(tracks, unit), encoding="utf-8")
    same(read_tracks(tmp_path / "t.trc"), tracks)
    np.testing.assert_allclose(
        read_tracks(tmp_path / "t.trc", "ft").position, tracks.position * 0.3048 / METRES[unit], rtol=1e-12
    )


def test_trc_of_a_path_in_latin_1(tracks, tmp_path):
    """As of recorders on Windows, whose first line has the file's path: one letter refused the file."""
    text = trc(tracks).replace("(X/Y/Z)\t", "(X/Y/Z)\tC:\\Jörg\\").replace("left", "Knöchel")
    (tmp_path / "t.trc").write_bytes(text.encode("latin-1"))
    found = read_tracks(tmp_path / "t.trc")
    assert [label.replace("Knöchel", "left") for label in found.labels] == list(tracks.labels)
    assert "Knöchel" in found.labels
    np.testing.assert_allclose(found.position, tracks.position, rtol=1e-12)


def test_trc_with_facts_left_out(tracks, tmp_path):
    text = trc(tracks).replace("\n2.0\t2.0\t40\t4\tmm", "\n\t\t40.0\t\tmm")
    (tmp_path / "t.trc").write_text(text, encoding="utf-8")
    same(read_tracks(tmp_path / "t.trc"), tracks)


@pytest.mark.parametrize(
    "change, expected",
    [
        (lambda text: "time,feature,x,y,z\n", "not marker tracks in TRC, which begin with PathFileType"),
        (lambda text: text.replace("\tmm\t", "\t\t"), "tells no unit of lengths, expected one to be told: --units"),
        (lambda text: text.replace("\tmm\t", "\tleague\t"), "lengths in 'league', expected one of m, cm, mm"),
        (
            lambda text: text.replace("Frame#", "Bild"),
            "line 4: begins with 'Bild, Time', expected Frame# and Time, and tabs between cells",
        ),
        (lambda text: text.replace("left\t\t\t", "left\t\t"), "line 4: expected a label above each three columns"),
        (lambda text: text.replace("\n3\t1.0\t", "\n3\t1.0\tone\t"), "line 9: 15 cells, expected 14"),
        (lambda text: text.replace("\n3\t1.0\t", "\n3\tone\t"), "line 9, column 2: found 'one', expected a number,"),
        (
            lambda text: text.replace(".", ","),
            r"t\.trc, line 7, column 2: found '0,0', expected a number, with a point, or nothing",
        ),
        (lambda text: text.replace("\n3\t1.0\t", "\n3\t0.5\t"), "time goes from 0.5 to 0.5"),
        (lambda text: text.replace("right", "left"), "label 'left' stands twice"),
        (lambda text: "\n".join(text.splitlines()[:6]), "no frames after line 5"),
        (lambda text: "\n".join(text.splitlines()[:26]), "line 3: NumFrames is 40, expected 20, as 20 frames follow"),
        (lambda text: text.replace("\t40\t4\t", "\t39\t4\t"), "line 3: NumFrames is 39, expected 40, as 40 frames"),
        (lambda text: text.replace("\t40\t4\t", "\t40\t5\t"), "line 3: NumMarkers is 5, expected 4, as 4 markers"),
        (lambda text: text.replace("\n2.0\t", "\n0\t"), "line 3: DataRate is '0', expected a number above 0"),
        (lambda text: text.replace("\n2.0\t", "\nfast\t"), "line 3: DataRate is 'fast', expected a number above 0"),
        (lambda text: text.replace("\n2.0\t", "\nnan\t"), "line 3: DataRate is 'nan', expected a number above 0"),
        (lambda text: text.replace("\t40\t4\t", "\tmany\t4\t"), "line 3: NumFrames is 'many', expected a number"),
    ],
)
def test_what_is_no_trc_is_refused_in_a_line(tracks, tmp_path, change, expected):
    (tmp_path / "t.trc").write_text(change(trc(tracks)), encoding="utf-8")
    with pytest.raises(InputError, match=expected) as raised:
        read_tracks(tmp_path / "t.trc")
    assert str(raised.value).startswith(str(tmp_path / "t.trc"))
    assert "\n" not in str(raised.value)

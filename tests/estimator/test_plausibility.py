"""Well-formed tracks that cannot be of one body in metres: the error names the likely cause."""

import numpy as np
import pytest

from baryscope.estimator import METHODS, FeatureTracks, estimate
from baryscope.estimator.plausibility import LARGEST, refuse_implausible
from baryscope.estimator.tables import tracks as tracks_table
from baryscope.models.errors import InputError
from baryscope.scripts.cli import app
from synthetic import box_features

FRAMES, FEATURES = 40, 5


def rows(label, time, scale=1.0):
    """The text of a track file; label and time of a row are functions of frame and feature."""
    points = scale * box_features(FEATURES, (10, 5, 5), seed=3)
    lines = [
        f"{time(k, i)},{label(k, i)},{x},{y},{z}" for k in range(FRAMES) for i, (x, y, z) in enumerate(points.tolist())
    ]
    return "\n".join(["time,feature,x,y,z", *lines]) + "\n"


def regular_label(_, i):
    return f"F{i}"


def regular_time(k, _):
    return k


CASES = {
    "millimetres": (
        rows(regular_label, regular_time, 1000.0),
        "m apart, in millimetres? (--units mm), expected metres and one body",
    ),
    "a time stamp for each feature": (
        rows(regular_label, lambda k, i: k + 0.01 * i),
        f"no two of the {FEATURES} features have a time in common, a time stamp for each feature?",
    ),
    "a new label in every row": (
        rows(lambda k, i: f"id{k * FEATURES + i}", regular_time),
        f"{FRAMES * FEATURES} labels in {FRAMES * FEATURES} observations, a new one in each, expected the same label",
    ),
    "a new label and a time in every row": (
        rows(lambda k, i: f"id{k * FEATURES + i}", lambda k, i: k + 0.01 * i),
        "a new one in each, expected the same label",
    ),
}


@pytest.mark.parametrize("mark", ["-9999", "0"])
def test_a_mark_for_what_is_not_seen_is_doubted(mark, tmp_path, capsys):
    """Such observations passed without a word, as outliers, or as a path that does not fit."""
    good = rows(regular_label, regular_time).splitlines()
    marked = list(good)
    for k in (3, 10, 17, 24):
        marked[k] = ",".join([*good[k].split(",")[:2], mark, mark, mark])
    path = tmp_path / "tracks.csv"
    path.write_text("\n".join(marked) + "\n")
    assert app.main(["estimate", str(path), "--trajectory", "fixed", "--no-report"]) in (0, 3)
    doubt = f"{path}: x, y and z are {mark} in 4 observations of 4 features: a mark for what is not seen? Such rows are"
    assert doubt in capsys.readouterr().err
    path.write_text("\n".join(good) + "\n")
    assert app.main(["estimate", str(path), "--trajectory", "fixed", "--no-report"]) in (0, 3)
    assert "a mark" not in capsys.readouterr().err


@pytest.mark.parametrize("case", CASES)
def test_the_command_names_the_likely_cause(case, tmp_path, capsys):
    text, expected = CASES[case]
    path = tmp_path / "tracks.csv"
    path.write_text(text)
    assert app.main(["estimate", str(path)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith(f"baryscope: {path}: ")
    assert expected in line
    assert sorted(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("method", METHODS)
def test_every_method_refuses_them(method, tmp_path):
    (tmp_path / "tracks.csv").write_text(CASES["millimetres"][0])
    with pytest.raises(InputError, match=r"tracks: features about .* millimetres"):
        estimate(FeatureTracks.read_csv(tmp_path / "tracks.csv"), method=method)


@pytest.mark.parametrize("case", ["a new label in every row", "a new label and a time in every row"])
def test_so_many_times_and_labels_that_arrays_of_them_would_be_too_large(case, tmp_path, monkeypatch):
    monkeypatch.setattr(tracks_table, "MOST_PLACES", FRAMES * FEATURES * FRAMES - 1)
    (tmp_path / "tracks.csv").write_text(CASES[case][0])
    with pytest.raises(
        InputError, match=r"tracks.csv: \d+ times and 200 labels in 200 rows, expected one time for all"
    ):
        FeatureTracks.read_csv(tmp_path / "tracks.csv")


def tracks_of(position):
    return FeatureTracks(np.arange(float(len(position))), position, [f"F{i}" for i in range(position.shape[1])])


def test_a_wide_body_blunders_and_bodies_too_wide_or_too_narrow():
    rng = np.random.default_rng(8)
    position = rng.uniform(-1, 1, (FRAMES, FEATURES, 3))
    refuse_implausible(tracks_of(0.4 * LARGEST * position), "it")
    blunders = position.copy()
    blunders[rng.random((FRAMES, FEATURES)) < 0.1] = 1e9
    refuse_implausible(tracks_of(blunders), "it")
    for scale in (3 * LARGEST, 1e9):
        with pytest.raises(InputError, match="millimetres"):
            refuse_implausible(tracks_of(scale * position), "it")
    for scale in (1e-7, 1e-160, 5e-324, 0.0):
        with pytest.raises(InputError, match=r"features about .* m apart, all in one place\?"):
            refuse_implausible(tracks_of(scale * position), "it")


def test_few_observations_are_left_to_the_estimators():
    """Two features that are never seen together, and one alone, may be all there is."""
    position = np.full((4, 2, 3), np.nan)
    position[::2, 0] = position[1::2, 1] = 1.0
    refuse_implausible(tracks_of(position), "it")
    refuse_implausible(tracks_of(position[:, :1]), "it")
    refuse_implausible(tracks_of(np.full((3, 2, 3), np.nan)), "it")

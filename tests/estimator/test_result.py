import csv
import json

import numpy as np
import pytest

from baryscope.estimator.methods import estimate
from baryscope.estimator.result import Estimate
from baryscope.models.errors import InputError

COLUMNS = ["time", "x", "y", "z", "cxx", "cxy", "cxz", "cyy", "cyz", "czz"]


def read(path):
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.reader(stream))


def refuse(name):
    raise AssertionError(f"{name} is no JSON")


def test_files_hold_the_path_and_strict_json(tmp_path):
    result = Estimate(
        np.array([0.0, 0.1 + 0.2]),
        np.array([[1.0, 2, 3], [1 / 3, -1e-300, 1e300]]),
        None,
        {
            "nan": np.nan,
            "infinity": np.float64(np.inf),
            "array": np.arange(3),
            "flag": np.True_,
            "n": np.int64(3),
            "µ": "ü",
        },
    )
    result.write(tmp_path / "deep" / "est.csv")
    rows = read(tmp_path / "deep" / "est.csv")
    assert rows[0] == COLUMNS
    assert rows[2][:4] == ["0.30000000000000004", "0.3333333333333333", "-1e-300", "1e+300"]
    assert rows[1][4:] == [""] * 6
    text = (tmp_path / "deep" / "est.json").read_text(encoding="utf-8")
    values = json.loads(text, parse_constant=refuse)
    assert values == {"nan": None, "infinity": None, "array": [0, 1, 2], "flag": True, "n": 3, "µ": "ü"}
    assert sorted(path.name for path in (tmp_path / "deep").iterdir()) == ["est.csv", "est.json"]


def test_covariance_is_written_where_there_is_one(tmp_path):
    Estimate(np.zeros(1), np.zeros((1, 3)), np.arange(9.0).reshape(1, 3, 3)).write(tmp_path / "e.csv")
    assert read(tmp_path / "e.csv")[1][4:] == ["0.0", "1.0", "2.0", "4.0", "5.0", "8.0"]


def test_diagnostics_say_what_was_done(case_of, at_rest, tmp_path):
    case = case_of(at_rest, noise=0.02, seed=5)
    estimate(case.tracks, method="screw-gpa").write(tmp_path / "e.csv")
    values = json.loads((tmp_path / "e.json").read_text(encoding="utf-8"), parse_constant=refuse)
    assert values["method"] == "screw-gpa"
    assert values["rejected_features"] == []
    # 11,000 observations of three coordinates less the unknowns: 1 % is four standard deviations.
    assert values["residual_rms"] == pytest.approx(0.02, rel=0.02)
    assert values["options"]["chosen_from_data"] == ["lag", "cutoff", "degree"]
    assert values["condition_number"] >= 1
    assert np.linalg.norm(values["least_observable_direction"]["direction"]) == pytest.approx(1)
    assert 0.5 < values["covered_share"] < 0.9
    assert values["wall_time"] > 0
    assert [len(cluster["features"]) for cluster in values["clusters"]] == [5, 4, 5, 3]


def test_the_centre_of_mass_in_the_axes_of_each_cluster(case_of, at_rest):
    """By the truth: the shape's axes are C's at the interval's first frame, its origin the features' centroid."""
    case = case_of(at_rest)
    found = estimate(case.tracks, method="screw-gpa")
    for cluster in found.diagnostics["clusters"]:
        members = [case.tracks.labels.index(name) for name in cluster["features"]]
        k = int(np.searchsorted(case.tracks.time, cluster["start"]))
        expected = -case.R_I_B[k] @ case.features[members].mean(axis=0)
        np.testing.assert_allclose(cluster["centre_of_mass"], expected, atol=1e-6)
        shape = (case.features[members] - case.features[members].mean(axis=0)) @ case.R_I_B[k].T
        np.testing.assert_allclose(list(cluster["features"].values()), shape, atol=1e-6)


def test_diagnostics_are_not_written_over_the_path(tmp_path):
    with pytest.raises(InputError, match="json"):
        Estimate(np.zeros(1), np.zeros((1, 3))).write(tmp_path / "e.json")
    assert list(tmp_path.iterdir()) == []

import csv
import json
import re
from dataclasses import fields, replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from baryscope.estimator import METHODS, estimate, write_estimate
from baryscope.estimator.document.document import kind_of, rejected_intervals
from baryscope.estimator.document.schema import EstimateDocument, FindingPart, schema, schema_text
from baryscope.estimator.findings import DifferentPoints, Finding, LackOfFit, WrongSigma
from baryscope.models.errors import ComputationError, InputError
from results import a_cluster, an_estimate
from synthetic import Orbit

pytestmark = pytest.mark.usefixtures("shared_pivot")

COLUMNS = ["time", "x", "y", "z", "cxx", "cxy", "cxz", "cyy", "cyz", "czz"]
SCHEMA = Path(__file__).parents[3] / "docs" / "estimate.schema.json"


def refuse(name):
    raise AssertionError(f"{name} is no JSON")


def written(result, folder):
    write_estimate(result, folder / "deep" / "e.csv")
    assert sorted(path.name for path in (folder / "deep").iterdir()) == ["e.csv", "e.json"]
    with (folder / "deep" / "e.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))
    text = (folder / "deep" / "e.json").read_text(encoding="utf-8")
    assert EstimateDocument.model_validate_json(text)
    return rows, json.loads(text, parse_constant=refuse)


def test_the_path_in_full_precision(tmp_path):
    time, position = np.array([0.0, 0.1 + 0.2]), np.array([[1.0, 2, 3], [1 / 3, -1e-300, 1e300]])
    result = an_estimate(frames=2, time=time, position=position, covariance=None, observability=None)
    rows, values = written(result, tmp_path)
    assert rows[0] == COLUMNS
    assert rows[2][:4] == ["0.30000000000000004", "0.3333333333333333", "-1e-300", "1e+300"]
    assert rows[1][4:] == [""] * 6
    assert (values["predicted_rmse"], values["observability"]) == (None, None)


def test_covariance_is_written_if_there_is_one(tmp_path):
    rows, _ = written(an_estimate(frames=1, covariance=np.arange(9.0).reshape(1, 3, 3)), tmp_path)
    assert rows[1][4:] == ["0.0", "1.0", "2.0", "4.0", "5.0", "8.0"]


def test_every_value_is_written(tmp_path):
    findings = (LackOfFit("fixed", 0.1, 90.0, 3), DifferentPoints(("a",), (0, 1)), WrongSigma(0.01, 0.02))
    residuals = np.full((10, 4, 3), 0.01)
    residuals[:, 3] = np.nan
    _, values = written(an_estimate(findings=findings, residuals=residuals), tmp_path)
    assert values["status"] == "model does not fit"
    assert values["noise"] == {"a_priori": None, "a_posteriori": 0.02, "unit": "m", "lasting": 1.0}
    assert values["predicted_rmse"] == pytest.approx(np.sqrt(14e-4))
    seen = values["observability"]
    assert (seen["cluster"], seen["observable"], seen["condition_number"]) == (0, [True] * 3, pytest.approx(9))
    assert seen["body"]["deviations"] == pytest.approx([0.01, 0.02, 0.03])
    np.testing.assert_allclose(np.abs(seen["body"]["directions"]), np.eye(3), atol=1e-12)
    (one,) = values["clusters"]
    assert (one["start"], one["end"], one["frames"], one["intervals"]) == (0.0, 9.0, 10, [[0.0, 9.0]])
    assert one["centre_of_mass"] == [-3.0, 0.0, 0.0]
    assert one["features"] == {"a": [1, 0, 0], "b": [-1, 0, 0], "c": [0, 1, 0], "d": [0, -1, 0]}
    np.testing.assert_allclose(one["centre_of_mass_covariance"], np.diag([1e-4, 4e-4, 9e-4]), atol=1e-18)
    assert values["residual_rms"] == {"a": 0.01, "b": 0.01, "c": 0.01, "d": None}
    lack, different, sigma = values["findings"]
    assert (sigma["kind"], sigma["given"], sigma["found"]) == ("wrong-sigma", 0.01, 0.02)
    assert (lack["kind"], lack["magnitude"], lack["dof"], lack["labels"]) == ("lack-of-fit", 0.1, 3, None)
    assert (different["kind"], different["labels"], different["clusters"]) == ("different-points", ["a"], [0, 1])
    ties = [{"clusters": [0, 1], "labels": ["a", "c"]}]
    assert values["details"] == {"kind": "pivot", "tie_points": ties, "position_noise": 0.0}


def test_rejected_intervals():
    rejected = np.zeros((10, 4), dtype=bool)
    rejected[2:5, 0] = rejected[7, 0] = rejected[:6, 1] = True
    assert rejected_intervals(an_estimate(rejected=rejected)) == {"a": ((2.0, 4.0), (7.0, 7.0)), "b": ((0.0, 5.0),)}
    assert rejected_intervals(an_estimate()) == {}


def test_numbers_that_are_not_finite_are_null(tmp_path):
    _, values = written(an_estimate(clusters=(a_cluster([0.0, 0.1, 0.2]),)), tmp_path)
    assert values["observability"]["condition_number"] is None


@pytest.mark.parametrize("method", METHODS)
def test_every_method_writes_according_to_the_schema(method, case_of, at_rest, tmp_path):
    tracks = case_of(at_rest, noise=0.02, seed=5).tracks
    if not method.startswith("screw"):  # whose choices need all frames
        tracks = replace(tracks, time=tracks.time[::5], position=tracks.position[::5])
    try:
        result = estimate(tracks, method=method, orbit=Orbit().model())
    except ComputationError:  # a path at rest in C is none of relative motion
        result = estimate(tracks, method=method)
    _, values = written(result, tmp_path)
    assert values["method"] == method
    assert 0.5 < values["coverage"] < 0.9
    assert values["wall_time"] > 0
    # 11,000 observations of three coordinates less the unknowns: 1 % is four standard deviations.
    if method.startswith("screw"):
        assert values["noise"]["a_posteriori"] == pytest.approx(0.02, rel=0.02)
        assert values["details"]["chosen_from_data"] == ["lag", "cutoff", "degree"]
        assert [len(cluster["features"]) for cluster in values["clusters"]] == [5, 4, 5, 3]


def test_the_documented_schema_is_the_one_in_use():
    """python -c "from baryscope.estimator.document.schema import schema_text as s; print(s(), end='')" prints it."""
    assert SCHEMA.read_text(encoding="utf-8") == schema_text()


def test_every_finding_can_be_written():
    """Its name in lower case is a kind, and its fields are among those of a finding."""
    properties = schema()["$defs"]["FindingPart"]["properties"]
    names = {kind.replace("-", "") for kind in properties["kind"]["enum"]}
    assert {finding.__name__.lower() for finding in get_args(Finding)} == names
    for finding in get_args(Finding):
        assert {field.name for field in fields(finding)} <= set(properties), finding.__name__


@pytest.mark.parametrize("field", sorted(set(FindingPart.model_fields) - {"kind", "text"}))
def test_the_schema_says_which_findings_have_a_field(field):
    """That of `magnitude` named departure alone, which lack-of-fit and frames-left-out have, too."""
    text = FindingPart.model_fields[field].description
    having = {kind_of(finding) for finding in get_args(Finding) if field in {one.name for one in fields(finding)}}
    kinds = map(kind_of, get_args(Finding))
    assert {kind for kind in kinds if re.search(rf"(?<![\w-]){kind}(?![\w-])", text)} == having


def test_the_page_names_every_field():
    page, found = SCHEMA.with_name("estimate.md").read_text(encoding="utf-8"), schema()
    for part in [found, *found["$defs"].values()]:
        assert set(part.get("properties", {})) <= set(re.findall(r"`(\w+)`", page)), part["title"]
    for kind in [*found["$defs"]["Status"]["enum"], *found["$defs"]["FindingPart"]["properties"]["kind"]["enum"]]:
        assert f"`{kind}`" in page


def test_the_json_is_not_written_over_the_path(tmp_path):
    with pytest.raises(InputError, match="json"):
        write_estimate(an_estimate(), tmp_path / "e.json")
    assert list(tmp_path.iterdir()) == []

"""Which draws stand for the others: by errors that are known."""

import json
import runpy

import numpy as np
import pytest

from baryscope.study.campaign import begin, plan_of, read_runs
from baryscope.study.campaign.draws import best_method, choices_of, code_of
from baryscope.study.campaign.folder import RUNS
from malformed import GOOD_SCENARIO


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "small.toml"
    path.write_text(GOOD_SCENARIO, encoding="utf-8")
    return plan_of([str(path)], methods=["score", "pivot", "ml"], draws=9, seed=3)


def runs_of(folder, plan, errors, claims=None):
    """Runs of errors (m) by method, NaN for a failure, in the order in which they ended; claims: as predicted, m."""
    begin(folder, plan)
    lines = []
    order = np.random.default_rng(4).permutation(plan.draws)
    for number in order.tolist():
        methods = {}
        for label in plan.methods:
            error = errors[label][number]
            claim = None if claims is None or label not in claims else claims[label][number]
            good = {"rmse": error, "max_error": error, "predicted_rmse": claim, "nees": None, "trustworthy": None}
            methods[label] = {"failure": "too dark"} if np.isnan(error) else good
        wall = {"flight": 0.25, "bound": 0.5, **dict.fromkeys(plan.methods, 1.0 + number)}
        head = {"plan": plan.identity, "seed": plan.seed, "scenario": "small", "case": number}
        varied = {"orbit.true_anomaly_deg": 10.0 * number}
        bound = {"path_rmse": 0.001, "path_rmse_clean": 0.001, "verdict": "observable"}
        lines.append(json.dumps(head | {"varied": varied, "bound": bound, "methods": methods, "wall": wall}) + "\n")
    (folder / RUNS).write_text("".join(lines), encoding="utf-8")
    return read_runs(folder, plan)


def spread(*numbers, scale=1e-3):
    return [scale * number for number in numbers]


LOST = float("nan")
PIVOT = spread(5, 3, 8, 1, 9, 2, 7, 4, 6)


def test_the_middle_draw_is_the_median_of_the_best_method(plan, tmp_path):
    """Of errors 1 to 9 mm that of 5 mm, which is draw 0; ml has a better best one, and a worse median."""
    errors = {"score": spread(*[20] * 9), "pivot": PIVOT, "ml": spread(0.1, 0.1, 0.1, 0.1, 6, 6, 6, 6, 6)}
    (middle,) = choices_of(plan, runs_of(tmp_path, plan, errors))
    assert (middle.number, middle.method, middle.rmse) == (0, "pivot", 0.005)
    assert "number 5 of the 9 draws with a result, by the RMSE of pivot, 5 mm" in middle.reason
    assert "the least is 1 mm, the largest 9 mm" in middle.reason
    assert middle.wall == pytest.approx(0.75 + 3 * 1.0)
    assert middle.values == (("orbit.true_anomaly_deg", 0.0),)


def test_a_method_that_mostly_fails_is_not_the_best(plan, tmp_path):
    """Draws without a result are the worst of all: of nine ml has four, pivot five."""
    few, half = spread(1, 1, 1, 1, *[LOST] * 5), spread(LOST, LOST, LOST, LOST, 9, 2, 7, 4, 6)
    runs = runs_of(tmp_path, plan, {"score": [LOST] * 9, "pivot": half, "ml": few})
    assert best_method(plan.methods, runs) == "pivot"
    (middle,) = choices_of(plan, runs)
    assert (middle.number, middle.rmse) == (8, 0.006)
    assert "number 3 of the 5 draws with a result" in middle.reason
    assert best_method(("score", "ml"), runs) == "ml"


def test_the_worst_for_its_claim_is_by_a_method_that_claims(plan, tmp_path):
    """Of pivot's draws number 3 has the least error, and 0.1 mm for its claim."""
    errors = {"score": spread(*[0.5] * 9), "pivot": PIVOT, "ml": spread(*[20] * 9)}
    claims = {"pivot": [error if number != 3 else 1e-4 for number, error in enumerate(PIVOT)], "ml": [1e-6] * 9}
    middle, worst = choices_of(plan, runs_of(tmp_path, plan, errors, claims))
    assert (middle.method, worst.method, worst.number) == ("score", "pivot", 3)
    assert "pivot has an RMSE of 1 mm, 10 times the 0.1 mm that it predicts" in worst.reason
    assert worst.wall == pytest.approx(0.75 + 3 * 4.0)


def test_of_one_draw_that_is_both_nothing_stands_twice(plan, tmp_path):
    errors = {"score": [LOST] * 9, "pivot": PIVOT, "ml": [LOST] * 9}
    claims = {"pivot": [1e-4, *PIVOT[1:]]}
    assert [one.number for one in choices_of(plan, runs_of(tmp_path, plan, errors, claims))] == [0]


def test_if_no_method_gave_a_result_it_is_the_first(plan, tmp_path):
    (first,) = choices_of(plan, runs_of(tmp_path, plan, dict.fromkeys(plan.methods, [LOST] * 9)))
    assert (first.number, first.rmse, first.name) == (0, None, "the first")


def test_the_lines_fly_the_draw_of_the_campaign(plan, tmp_path, monkeypatch):
    """In its folder; with other flights in the place of them, since these are tested elsewhere."""
    begin(tmp_path, plan)
    monkeypatch.chdir(tmp_path)
    told = []
    monkeypatch.setattr("baryscope.study.compare", lambda scenario, methods: (scenario, methods))
    monkeypatch.setattr("baryscope.study.write_comparison", lambda made, folder: told.append((*made, folder)))
    (tmp_path / "draw.py").write_text("\n".join(code_of(plan, "small", 2)), encoding="utf-8")
    runpy.run_path("draw.py")
    ((scenario, methods, folder),) = told
    generator = np.random.SeedSequence([3, 2]).spawn(3)[2]
    assert scenario.run.seed == int(generator.generate_state(1, np.uint32)[0])
    assert (methods, folder) == (["score", "pivot", "ml"], "draw-2")

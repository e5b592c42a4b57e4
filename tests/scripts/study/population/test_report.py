"""What counts as wrong, announced, refused and clear."""

import json
import subprocess
import sys

import numpy as np
import pytest

from baryscope.estimator import estimate
from baryscope.study.population.__main__ import main
from baryscope.study.population.ahead import CENTRE, FEATURE, WHEN, misses
from baryscope.study.population.judging import of_estimate, prepared, wrong
from baryscope.study.population.report import by_status, failing, predictions, refusals, table

FACTS = {"seed": 1, "index": 0, "orbit": True, "wall": 0.1, "radius": 1.0, "bounds": {"free orbit": 0.1}, "kind": ""}
ANSWER = FACTS | {
    "method": "pivot",
    "status": "good",
    "announced": False,
    "path": "relative-orbit",
    "error": [0.1, 0.1, 0.1],
    "nees": [2.0, 3.0, 4.0],
    "rmse": 0.1,
    "rounds": 3,
    "sigma": 0.02,
    "definite": True,
}


def row(*lines):
    made = table(lines)
    return dict(zip(made.headings, made.rows[0], strict=True))


def test_one_of_three_times_is_enough_to_be_wrong():
    assert not wrong(ANSWER)
    assert wrong(ANSWER | {"nees": [2.0, 16.3, 1.0]})
    assert wrong(ANSWER | {"nees": [2.0, np.nan, 1.0]})


def test_answers_are_counted_by_what_they_claim():
    bad = ANSWER | {"nees": [20.0, 20.0, 20.0]}
    found = row(ANSWER, ANSWER, ANSWER, bad, ANSWER | {"announced": True}, bad | {"announced": True})
    assert (found["answers"], found["unannounced"]) == ("6", "4")
    assert found["wrong"] == "1 (25.0 %)"
    assert found["right but announced"] == "1 (25.0 %)"
    assert found["rms/bound"] == "1.00"


def test_answers_are_told_apart_by_their_status():
    poor = ANSWER | {"status": "not observable", "nees": [20.0, 0.1, 0.1]}
    refusal = FACTS | {"method": "pivot", "failure": "features in a line", "message": "…"}
    found = by_status([ANSWER, poor, ANSWER, ANSWER | {"orbit": False}, refusal])
    assert found.rows == (
        ("pivot", "yes", "good", "2", "0 (0.0 %)", "3.00"),
        ("pivot", "yes", "not observable", "1", "1 (100.0 %)", "0.10"),
        ("pivot", "no", "good", "1", "0 (0.0 %)", "3.00"),
    )


def test_predictions_are_counted_by_what_they_claim():
    fine = {
        f"{name} {when}": {"error": 0.1, "claimed": 0.2, "nees": 5.0} for name in (CENTRE, FEATURE) for when in WHEN
    }
    refused = {key: one for key, one in fine.items() if CENTRE in key} | {FEATURE: "no tumble"}
    bad = fine | {f"{CENTRE} span": {"error": 1.0, "claimed": 0.2, "nees": 22.5}}
    lines = [ANSWER | {"predicted": one} for one in (fine, bad, refused)]
    lines += [ANSWER | {"predicted": bad, "announced": True}, ANSWER]
    found = predictions(lines)
    rows = {cells[2:4]: dict(zip(found.headings, cells, strict=True)) for cells in found.rows}
    assert len(rows) == len(found.rows) == 6
    assert rows[CENTRE, "span"]["wrong"] == "1 (33.3 %)"
    assert rows[CENTRE, "quarter"]["wrong"] == "0 (0.0 %)"
    assert rows[CENTRE, "span"]["greatest claim"] == "0.2 m"
    assert (rows[FEATURE, "span"]["predictions"], rows[FEATURE, "span"]["refused"]) == ("2", "1")
    assert misses(lines[1]) == ["centre span"]
    assert [line[:20] for line in failing(lines)] == ["wrong at centre span"]


def test_a_refusal_is_clear_if_the_bound_is_small():
    refusal = FACTS | {"method": "pivot", "failure": "features in a line", "message": "…"}
    hopeless = refusal | {"bounds": {"free orbit": 0.3}}
    found = row(ANSWER, refusal, hopeless)
    assert (found["refused"], found["of them clear"]) == ("2", "1")
    assert refusals([ANSWER, refusal, hopeless]).rows == (("pivot", "features in a line", "2", "1"),)
    assert [line[:7] for line in failing([ANSWER, refusal, hopeless])] == ["refused"]


def test_a_line_is_that_of_the_estimate():
    case, sample, _ = prepared(1, 1)
    found = estimate(sample.tracks, orbit=case.orbit)
    line = of_estimate(found, case.path)
    error = found.position[-1] - case.path[-1]
    assert line["nees"][2] == pytest.approx(error @ np.linalg.solve(found.covariance[-1], error))
    assert line["definite"]


def test_a_run_is_resumed_and_reported(tmp_path, capsys):
    output = str(tmp_path / "results.jsonl")
    for _ in range(2):
        main(["run", "--cases", "1", "--first", "1", "--methods", "score", "-o", output])
    assert main(["report", output, "--failing"]) == 0
    assert capsys.readouterr().out.count("| score |") == 4  # with the orbit and without, in two tables


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "--methods", "pivot,nothing", "-o", "x"], "found 'nothing', expected some of screw-raw"),
        (["run", "--workers", "0", "-o", "x"], "found 0, expected a whole number above it"),
        (["run", "--seed", "-1", "-o", "x"], "found '-1', expected a whole number from 0 on"),
        (["report", "no.jsonl"], "no.jsonl: not found, expected a file of results"),
        (["report", "broken.jsonl"], "broken.jsonl, line 1: Expecting value"),
    ],
)
def test_a_wrong_argument_is_one_line(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.jsonl").write_text("what\n", encoding="utf-8")
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_draws_of_a_case_differ_by_their_noise_alone(capsys):
    main(["case", "--seed", "2", "--index", "2", "--draws", "3"])
    title, _, *rows = capsys.readouterr().out.splitlines()
    assert title.startswith("3 draws, 3 of them answered without a remark; of these wrong: ")
    found = [row.split() for row in rows]
    assert [row[:3] for row in found] == [[str(k), *found[0][1:3]] for k in (1, 2, 3)]
    assert len({row[-3] for row in found}) == 3
    errors, claims = np.array([row[-3:-1] for row in found], dtype=float).T
    assert claims.max() < 2 * claims.min()
    assert errors.max() < 4 * claims.max()


def test_a_reader_who_has_seen_enough_is_no_error(tmp_path):
    file = tmp_path / "lines.jsonl"
    file.write_text(json.dumps(ANSWER) + "\n")
    command = [sys.executable, "-m", "baryscope.study.population", "report", str(file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 1

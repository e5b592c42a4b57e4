"""Cases of another population by the same command: their lines say so, and are not taken for the first's."""

import json
from itertools import chain

from baryscope.study.population import command
from baryscope.study.population.__main__ import main
from baryscope.study.population.judging import prepared
from baryscope.study.population.populations import POPULATIONS


def test_lines_of_the_second_say_so_and_are_resumed(in_process, tmp_path, capsys):
    output = tmp_path / "results.jsonl"
    run = ["run", "--seed", "2", "--first", "3", "--cases", "1", "--methods", "score", "-o", str(output)]
    for population in ([], ["--population", "second"], [], ["--population", "second"]):
        main([*run, *population])
    lines = [json.loads(line) for line in output.read_text(encoding="utf-8").splitlines()]
    assert [line.get("population") for line in lines] == [None, None, "second", "second"]
    assert lines[2]["kind"] == POPULATIONS["second"](2, 3)[0].kind != lines[0]["kind"]
    assert main(["report", str(output)]) == 0
    assert "| score | yes | 2 |" in capsys.readouterr().out


def test_estimates_without_the_orbit_alone(in_process, tmp_path):
    output = tmp_path / "results.jsonl"
    run = ["run", "--seed", "2", "--first", "3", "--cases", "1", "--methods", "score", "-o", str(output)]
    expected = [False], [False, True]  # then those that the file does not have yet
    for chosen, orbits in zip((["--without-orbit"], []), expected, strict=True):
        main([*run, *chosen])
        assert [json.loads(line)["orbit"] for line in output.read_text(encoding="utf-8").splitlines()] == orbits


def test_one_killed_says_of_which_population_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "run", lambda _function, groups, *_: ((task, None) for task in chain(*groups)))
    output = tmp_path / "results.jsonl"
    run = ["run", "--cases", "1", "--methods", "score", "-o", str(output)]
    for population in ("first", "second"):
        main([*run, "--population", population])
    lines = [json.loads(line) for line in output.read_text(encoding="utf-8").splitlines()]
    assert {line["failure"] for line in lines} == {"killed"}
    assert [line.get("population") for line in lines] == [None, None, "second", "second"]


def test_a_case_of_the_second_is_drawn_with_other_noise(capsys):
    main(["case", "--population", "second", "--seed", "2", "--index", "3", "--orbit", "--draws", "2"])
    assert capsys.readouterr().out.startswith("2 draws, 2 of them answered without a remark; of these wrong: 0")


def test_a_target_in_a_laboratory_is_estimated_without_an_orbit_only(in_process, tmp_path, capsys):
    index = next(index for index in range(100) if not POPULATIONS["third"](2, index)[0].orbital)
    output = tmp_path / "results.jsonl"
    main(
        [
            "run",
            "--population",
            "third",
            "--seed",
            "2",
            "--first",
            f"{index}",
            "--cases",
            "1",
            "--methods",
            "score",
            "-o",
            f"{output}",
        ]
    )
    first, second = (json.loads(line) for line in output.read_text(encoding="utf-8").splitlines())
    assert (first["orbit"], first["skipped"]) == (True, "no orbit")
    assert not second["orbit"]
    assert "rmse" in second
    assert main(["report", str(output)]) == 0
    said = capsys.readouterr().out
    assert "| score | no |" in said
    assert "| score | yes |" not in said


def test_the_populations_draw_different_cases():
    assert len({len(prepared(2, 3, name)[0].time) for name in POPULATIONS}) == len(POPULATIONS)

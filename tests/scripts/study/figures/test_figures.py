"""The paper's figures, of a tenth of an orbit."""

import json
from dataclasses import replace

import numpy as np
import pytest

from baryscope.models.errors import InputError
from baryscope.models.scenario import load_scenario
from baryscope.scripts.cli.app import main
from baryscope.study.bounds import variant_of
from baryscope.study.figures import FIGURES, figure_paths, run_paper
from baryscope.study.figures.run import DISTANCES, PUBLISHED, errors_of


@pytest.fixture(scope="module")
def run():
    envisat = load_scenario("envisat")
    return run_paper(replace(variant_of(envisat), duration=600.0).of(envisat))


def test_without_noise_the_axes_miss_by_what_geometry_says(run):
    """The axis of a finite screw is ‖d⊥‖/(2 tan(θ/2)) from the middle of a point's way d (Chasles)."""
    for misses, factor in zip(run.misses, DISTANCES, strict=True):
        assert misses.distance == pytest.approx(factor * 20.0)
        inner = slice(100, -100)  # the low-pass bends the axes at the ends of a run
        np.testing.assert_allclose(misses.axis[inner], misses.expected[inner], rtol=0.01)


def test_the_error_of_the_axes_grows_with_the_distance_and_not_with_the_noise(run):
    medians = [np.median(misses.middle) for misses in run.misses]
    np.testing.assert_allclose(np.array(medians) / medians[0], np.array(DISTANCES) / DISTANCES[0], rtol=0.01)
    noisy, exact = (np.nanmedian(errors_of(stages, run.true_path)) for stages in (run.published, run.exact))
    assert noisy == pytest.approx(exact, rel=0.05)


def test_the_sentences_have_the_numbers_of_the_run(run):
    rmse = np.sqrt(np.mean(np.sum((run.outcome(PUBLISHED).estimate.position - run.true_path) ** 2, axis=1)))
    sentences = {figure.number: figure.sentence(run) for figure in FIGURES}
    assert f"off by {rmse:.2f} m rms" in sentences[9]
    assert sentences[2].startswith("12 features, 5 at most at a time, make 1 cluster; nothing is seen in 0 %")
    kept = np.linalg.norm(run.path_in_L - [0, -20, 0], axis=1).max()  # V-bar is behind, along-track
    assert f"moves by {1000 * kept:.2f} mm at most" in sentences[3]
    raw = 0.02 * 1e3  # the noise told in the scenario; 5 × 3 × 601 draws scatter by 0.8 %
    assert float(sentences[6].split(" rms for ")[1].split(" mm")[0]) == pytest.approx(raw, rel=0.03)


def test_the_sentences_say_what_ours_shows_where_the_paper_shows_another(run):
    """Those of the bars, the trajectory and the fit told of our run alone."""
    sentences = {figure.number: figure.sentence(run) for figure in FIGURES}
    assert "The paper's bars have such clusters" in sentences[2]
    assert sentences[2].endswith("ours show that none of the features is in more than one.")  # of a single cluster
    assert sentences[3].startswith("The paper shows the relative trajectory")
    assert "The paper shows how the polynomial fits the pseudo-intersections; ours has the truth" in sentences[8]


def test_the_command_draws_each_figure_and_puts_it_on_the_page(run, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("baryscope.scripts.cli.figures.run_paper", lambda scenario, progress: run)
    folder = tmp_path / "new"
    assert main(["figures", "-o", str(folder), "--json", "--quiet"]) == 0
    told = json.loads(capsys.readouterr().out)
    page, *pictures = figure_paths(folder)
    text = page.read_text(encoding="utf-8")
    assert [one["number"] for one in told["figures"]] == list(range(2, 10))
    for figure, one, path in zip(FIGURES, told["figures"], pictures, strict=True):
        assert one["sentence"] == figure.sentence(run)
        assert f"]({path.name})" in text
        assert figure.sentence(run) in text
        assert path.read_bytes().startswith(b"\x89PNG")
    assert set(folder.iterdir()) == {page, *pictures}


def test_a_file_is_no_folder_and_matplotlib_is_needed(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(InputError, match="is a file, expected a folder"):
        figure_paths(tmp_path / "file")
    monkeypatch.setattr("baryscope.study.figures.folder.pictures_possible", lambda: False)
    with pytest.raises(InputError, match="need matplotlib"):
        figure_paths(tmp_path / "other")

"""The study of joints: its recordings are what they say, its lines judge against the truth, its table counts right."""

import numpy as np
import pytest

from baryscope.study.joints.__main__ import main
from baryscope.study.joints.judging import judged, regions, table
from baryscope.study.joints.recordings import (
    IN_CHILD,
    LASTING,
    MOTIONS,
    NOISES,
    RINGING,
    SHAPE,
    STEP,
    by_angle,
    gait,
    in_step,
    lasting,
    recorded,
    ringing,
)
from baryscope.study.population.running import append


@pytest.mark.parametrize("motion", MOTIONS)
def test_without_skin_and_noise_both_bodies_have_the_joint(motion, monkeypatch):
    """The child's markers are as far from the joint as in its own axes; and a hinge leaves what is along its axis."""
    monkeypatch.setattr("baryscope.study.joints.recordings.SKIN", 0.0)
    monkeypatch.setattr("baryscope.study.joints.recordings.OWN", 0.0)
    made = recorded(motion, "lasting", 1)
    arms = made.child - made.joint[:, None]
    far = np.linalg.norm(SHAPE - IN_CHILD, axis=1)
    np.testing.assert_allclose(np.linalg.norm(arms, axis=2), np.broadcast_to(far, arms.shape[:2]), atol=1e-12)
    if motion == "hinge":
        along = np.einsum("kmi,ki->km", arms, made.axis)
        np.testing.assert_allclose(along, np.broadcast_to(along[0], along.shape), atol=1e-12)


def test_noises_have_the_variance_and_the_rhythm_that_they_say():
    """Variances over 60 draws, and correlations at a lag, within 4 of their standard deviations."""
    draws = [np.random.default_rng(seed) for seed in range(60)]
    motion = gait(np.random.default_rng(0))
    for noise, spread in ((NOISES["white"], 0.02), (in_step, 0.45), (by_angle, 0.5)):
        assert np.mean([noise(rng, motion) ** 2 for rng in draws]) == pytest.approx(1, abs=spread)
    slow = np.array([lasting(rng, (600, 3), LASTING) for rng in draws])
    lag = round(LASTING / STEP)
    assert np.mean(slow**2) == pytest.approx(1, abs=0.1)
    assert np.mean(slow[:, lag:] * slow[:, :-lag]) == pytest.approx(np.exp(-1), abs=0.1)
    rung = np.array([ringing(rng) for rng in draws])
    half = round(0.5 / RINGING / STEP)
    assert np.mean(rung**2) == pytest.approx(1, abs=0.1)
    assert np.mean(rung[:, half:] * rung[:, :-half]) < -0.6  # against, and exp(−0.1 π) = 0.73 as much


def test_a_noise_in_step_is_the_same_in_each_stride():
    motion = gait(np.random.default_rng(3))
    skin = in_step(np.random.default_rng(4), motion)
    strides = motion.phase[0] + 2 * np.pi * np.array([2.25, 3.25, 4.25])
    again = np.stack([np.interp(strides, motion.phase, column) for column in skin.T])
    np.testing.assert_allclose(again, np.broadcast_to(again[:, :1], again.shape), atol=0.02)  # of interpolation


def test_a_line_has_the_error_beside_the_claim_and_the_table_counts(capsys, tmp_path):
    line = judged("circles", "lasting", 1, 0, "ml")
    assert line["error"] < 0.01
    assert 1e-4 < line["claimed"] < 0.01
    assert "axis_nees" not in line
    knee = judged("hinge", "white", 1, 0, "score")
    assert knee["hinge"]
    assert knee["axis_error"] < np.deg2rad(1)
    rows = table([line, line | {"draw": 1, "nees": 20.0}, knee]).rows
    assert [row[:4] for row in rows] == [("circles", "lasting", "ml", "2"), ("hinge", "white", "score", "1")]
    assert rows[0][9] == "50.0 %"
    for one in (knee, line):
        append(tmp_path / "a.jsonl", one)
    assert main(["report", str(tmp_path / "a.jsonl")]) == 0
    names = [row.split(" | ")[:3] for row in capsys.readouterr().out.splitlines()[2:]]
    assert names == [["| circles", "lasting", "ml"], ["| hinge", "white", "score"]]


def test_regions_hold_what_they_should(capsys, tmp_path):
    """Of true answers, NEES being χ² of 3, as many as they say, within 4 standard deviations of a share of 2000; and a
    few that are far off, which are the whole of the mean of NEES, cost each region no more than their own share.
    """
    line = {
        "motion": "gait",
        "noise": "by angle",
        "method": "ml",
        "error": 0.01,
        "claimed": 0.01,
        "hinge": False,
        "wall": 0,
    }
    true = np.random.default_rng(5).chisquare(3, 2000)
    (row,) = regions([line | {"nees": nees} for nees in true]).rows
    assert row[:4] == ("gait", "by angle", "ml", "2000")
    for cell, share in zip(row[4:], (0.5, 0.9, 0.95, 0.99), strict=True):
        assert float(cell.removesuffix(" %")) / 100 == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 2000))
    (far,) = regions([line | {"nees": nees} for nees in (*true, *[1e4] * 20)]).rows
    ours, its = (np.array([float(cell.removesuffix(" %")) for cell in one[4:]]) for one in (row, far))
    np.testing.assert_allclose(its, ours * 2000 / 2020, atol=0.11)  # of two rounded cells
    assert regions([line | {"failure": "too few frames"}]).rows[0][3:] == ("0", *["-"] * 4)
    for draw, nees in enumerate((1.0, 7.0)):  # within 7.81, the limit of 95 %; the second beyond 6.25, that of 90 %
        append(tmp_path / "a.jsonl", line | {"seed": 1, "draw": draw, "nees": nees})
    assert main(["report", "--regions", str(tmp_path / "a.jsonl")]) == 0
    assert (
        capsys.readouterr().out.splitlines()[2] == "| gait | by angle | ml | 2 | 50.0 % | 50.0 % | 100.0 % | 100.0 % |"
    )

"""What came of a flown loop, in numbers, in a few lines, and in a verdict."""

from dataclasses import replace

import pytest
from scipy.stats import chi2

from baryscope.scripts.cli.fly import _words
from baryscope.study.loop_report import verdict_of_loop
from baryscope.study.loop_summary import WRONG, summary_of


def test_a_false_claim_in_the_first_half_is_told(held):
    """The mean NEES of the second half hid it: for 50 s deviations are a hundredth of what they should be."""
    covariance = held.covariance.copy()
    covariance[100:150] /= 1e4
    found, honest = summary_of(replace(held, covariance=covariance)), summary_of(held)
    assert honest["wrong_share"] < 0.01
    assert found["mean_nees"] == honest["mean_nees"]
    assert found["largest_nees"] == pytest.approx(1e4 * held.nees[100:150].max())
    assert found["wrong_share"] == pytest.approx(
        (1e4 * held.nees[100:150] > WRONG).sum() / held.tracking.sum(), abs=0.01
    )
    assert pytest.approx(chi2.ppf(0.999, 3), rel=1e-4) == WRONG
    share = f"{100 * found['wrong_share']:.3g}"
    told = f"NEES at most {found['largest_nees']:.3g}, claims too small for {share} % of the time"
    assert f"while tracking: {told}" in "\n".join(_words(found))
    assert verdict_of_loop(honest) == ("good", "At last the estimator tracks the target.")
    assert verdict_of_loop(found)[0] == "warn"
    never = _words(summary_of(replace(held, covariance=covariance / 1e4)))
    assert any(line.endswith("claims too small for 100 % of the time") for line in never)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tracking_since": None, "status": "starting"}, "The estimator never tracked the target: it is starting."),
        ({"last_claim": 25.0}, "The centre of mass may be farther off than the target is away."),
        ({"retreating_since": 300.0}, "At last the estimator tracks the target. The chaser retreats."),
        ({"status": "lost"}, "At last the estimator has lost the target."),
    ],
)
def test_a_flight_of_which_nothing_came_is_no_mild_one(held, change, words):
    """Never tracked, with a claim of 10 km, was *with limits*."""
    grade, said = verdict_of_loop(summary_of(held) | change)
    assert grade == "bad"
    assert words in said
    assert verdict_of_loop(summary_of(held) | {"status": "starting"})[0] == "warn"

"""The bank of hypotheses against likelihoods in closed form."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import digamma
from scipy.stats import invgamma

from baryscope.estimator.ekf.bank import DECADES, Axis, Bank, Member, level_of
from baryscope.estimator.ekf.solution import IMPOSSIBLE

NONE = Axis(1.0, "none")


def bell(height, middle, width):
    """Log-likelihoods of members that go with the logarithm of the path's density as a bell above that of none."""

    def evaluate(members):
        off = np.array([np.log10(member.path / middle) / width if member.path else np.inf for member in members])
        return np.log1p(np.expm1(height) * np.exp(-0.5 * off**2))

    return evaluate


@pytest.mark.parametrize("middle", [1e-3, 3e-2, 4.0, 2e3])
def test_the_posterior_finds_densities_to_which_no_step_leads(middle):
    """None is the best of its neighbours; a bell of e^2.5 and half a decade is as probable, as by an integral."""
    width, height = 0.5, 2.5
    bank = Bank(Axis(1.0, "auto"), NONE, bell(height, middle, width))
    best = bank.best(Member(0.0, 0.0))
    assert best == Member(0.0, 0.0)
    members, probability = bank.posterior(best)
    x = np.linspace(-4, 8, 12001)
    ratio = 1 + np.expm1(height) * np.exp(-0.5 * ((x - np.log10(middle)) / width) ** 2)
    near = float(np.trapezoid(ratio, x)) / DECADES
    found = sum(p for member, p in zip(members, probability, strict=True) if member.path > 0)
    assert found == pytest.approx(near / (1 + near), abs=0.05)
    # Levels of a decade, and of two where the likelihood is that of none.
    logarithm = [np.log10(member.path) for member in members if member.path > 0]
    assert min(abs(np.array(logarithm) - np.log10(middle))) <= 0.5


@pytest.mark.parametrize("middle", [1e-3, 2e-3, 5e-1, 4.0, 60.0, 2e3])
def test_the_search_ends_at_the_level_nearest_to_the_maximum(middle):
    """Levels are a decade apart, those that are tried first two: it goes up or down to the others."""
    best = Bank(Axis(1.0, "auto"), NONE, bell(20.0, middle, 0.5)).best(None)
    assert best.path == pytest.approx(10 ** np.round(np.log10(middle)))


@pytest.mark.parametrize("height", [0.0, 1.0, 2.0])
def test_many_members_of_little_probability_are_not_left_out_together(height):
    """Both noises may be none, or any from 1e-4.5 to 1e4.5, which is as many times as probable as the height says."""
    free = Axis(1.0, "auto")

    def evaluate(members):
        pairs = np.array([[member.path, member.turn] for member in members])
        return np.where(pairs.max(axis=1) > 3e4, -1e3, height * (pairs > 0).sum(axis=1))

    bank = Bank(free, free, evaluate)
    members, probability = bank.posterior(bank.best(Member(0.0, 0.0)))
    none = sum(p for member, p in zip(members, probability, strict=True) if member.path == 0)
    assert none == pytest.approx(1 / (1 + 9 / DECADES * np.exp(height)), abs=0.1)


def test_a_density_that_is_given_is_the_only_one():
    bank = Bank(Axis(1.0, 1e-3), NONE, bell(1.0, 1e-3, 1.0))
    best = bank.best(None)
    assert best == Member(1e-3, 0.0)
    members, probability = bank.posterior(best)
    assert members == [best]
    assert probability.tolist() == [1.0]


def test_the_level_is_the_density_that_moves_by_a_variance():
    """Of white acceleration q the variance of a place is q ∫ (T − t)² dt after T."""
    variance, span = 0.04, 30.0
    moved = quad(lambda t: (span - t) ** 2, 0.0, span)[0]
    assert level_of(variance, span) * moved == pytest.approx(variance)


@pytest.mark.parametrize("most", [2.0, 4.0, 7.0, 2e3])
def test_the_mean_density_has_its_improbable_members(most):
    """Of a likelihood e^(−q/a), as of tracks that show none: a/u/(1 + (ln (a/1e-4) − γ)/u), u = DECADES ln 10.

    The trapezoidal rule in steps of a decade is good to 2 |Γ(1 + 2πi/ln 10)| = 11 %. Without the members of less than
    2 % each, it was 0.8, 0.5, 0.3 and 0.8 of that.
    """
    bank = Bank(Axis(1.0, "auto"), NONE, lambda members: np.array([-member.path / most for member in members]))
    unit = DECADES * np.log(10)
    expected = most / unit / (1 + (np.log(most / 1e-4) - np.euler_gamma) / unit)
    assert bank.mean(bank.best(Member(0.0, 0.0))).path == pytest.approx(expected, rel=0.13)


@pytest.mark.parametrize("values", [20, 200, 1000, 6000])
@pytest.mark.parametrize("most", [2e-3, 0.4, 30.0])
def test_a_density_that_tracks_tell_well_is_found_between_the_levels(values, most):
    """As of so many white values of a mean square: with a prior uniform in the logarithm an inverse gamma distribution.

    With levels a decade apart the best was up to 2.5 times the likeliest, and its bounds the same.
    """
    true, deviation = invgamma(values / 2, scale=most * values / 2), np.sqrt(2 / values)

    def evaluate(members):
        density = np.array([member.path for member in members])
        return true.logpdf(density) + np.log(density, where=density > 0, out=np.zeros_like(density))

    bank = Bank(Axis(1.0, "auto"), NONE, evaluate)
    best = bank.best(None)
    # The trapezoidal rule on levels of one to two standard deviations.
    np.testing.assert_allclose(np.log(bank.bounds(best)[0]), np.log(true.ppf([0.05, 0.95])), atol=0.5 * deviation)
    members, probability = bank.posterior(best)
    density = np.array([member.path for member in members])
    assert abs(np.log(density[np.argmax(probability)] / most)) < 1.5 * deviation
    mean = probability @ np.log(density)
    assert mean == pytest.approx(np.log(most * values / 2) - digamma(values / 2), abs=0.3 * deviation)


def test_densities_with_which_the_filter_diverges_have_no_probability():
    """As those of little torque of an unstable motion: differences of such scores warned of what is no number."""
    whole = bell(20.0, 60.0, 0.5)

    def evaluate(members):
        diverges = np.array([member.path < 1.0 for member in members])
        return np.where(diverges, IMPOSSIBLE, whole(members))

    bank = Bank(Axis(1.0, "auto"), NONE, evaluate)
    best = bank.best(None)
    members, probability = bank.posterior(best)
    assert sum(p for member, p in zip(members, probability, strict=True) if member.path < 1.0) == 0
    assert bank.significance(best) > 0
    low, high = bank.bounds(best)[0]
    assert 1.0 <= low < 60.0 < high

"""The study of criteria for a polynomial's degree: its criteria by their textbook forms, and its table."""

import numpy as np
import pytest

from baryscope.scripts.benchmarks.degree_study import CRITERIA, PATHS, table

# −2 ln L of n Gaussian residuals is n ln Σr² and a constant; K counts the variance, too.
TEXTBOOK = {
    "AIC": lambda n, K: 2 * K,
    "AICc": lambda n, K: 2 * K + 2 * K * (K + 1) / (n - K - 1),
    "Hannan–Quinn": lambda n, K: 2 * K * np.log(np.log(n)),
    "BIC": lambda n, K: K * np.log(n),
}


@pytest.mark.parametrize("name", TEXTBOOK)
def test_criteria_are_those_of_the_textbook(name):
    (criterion,) = (one for label, one in CRITERIA.items() if label.startswith(f"{name},"))
    n, unknowns, squares = 50.0, np.array([3.0, 6.0, 9.0, 12.0]), np.array([9.0, 4.0, 3.5, 3.4])
    expected = n * np.log(squares) + TEXTBOOK[name](n, unknowns + 1)
    np.testing.assert_allclose(np.diff(criterion(n, squares, unknowns)), np.diff(expected), atol=1e-10)


def test_the_table_compares_all_criteria_with_the_best_degree():
    head, _, *rows = (line.strip("| ").split(" | ") for line in table(1).splitlines())
    assert [row[0] for row in rows] == list(CRITERIA)
    assert len(head) == 1 + 2 * len(PATHS)
    errors = np.array([[float(cell) for cell in row[1::2]] for row in rows])
    assert (errors >= 1).all()
    shares = {float(cell.removesuffix(" %")) for row in rows for cell in row[2::2]}
    assert shares <= {0.0, 100.0}

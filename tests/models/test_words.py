import pytest

from baryscope.models.words import counted


@pytest.mark.parametrize("number, words, expected", [
    (0, ("cluster",), "0 clusters"),
    (1, ("cluster",), "1 cluster"),
    (2, ("cluster",), "2 clusters"),
    (1, ("process", "processes"), "1 process"),
    (3, ("feature is", "features are"), "3 features are"),
])  # fmt: skip
def test_one_is_singular(number, words, expected):
    assert counted(number, *words) == expected

"""Scenario files to spoil: a small one that is right, and a writer of variants of it."""

import pytest

GOOD_SCENARIO = """\
description = "a small body"

[target]
inertia = [[2.0, 0.1, 0.0], [0.1, 3.0, 0.2], [0.0, 0.2, 4.0]]
attitude = [1.0, 0.0, 0.0, 0.0]
angular_rate_deg = [1.0, 2.0, 3.0]

[features]
points = [
    { label = "a", position = [1.0, 0.0, 0.0], normal = [1, 0, 0] },
    { label = "b", position = [0.0, 1.0, 0.0], normal = [0, 1, 0] },
    { label = "c", position = [0.0, 0.0, 1.0], normal = [0, 0, 1] },
    { label = "d", position = [-1.0, 0.5, 0.0], normal = [-1, 0, 0] },
]

[orbit]
semi_major_axis = 7.0e6
eccentricity = 0.01
inclination_deg = 50.0

[chaser]
position = [0.0, -10.0, 0.0]

[tracking]
intervals = [
    { start = 0, end = 40, features = ["a", "b", "c"] },
    { start = 60, end = 100, features = ["b", "c", "d"] },
]

[sensor]
noise = 0.02

[run]
duration = 100.0
sample_time = 1.0
seed = 7
"""


@pytest.fixture
def write_scenario(tmp_path):
    """Write the good scenario with some of its text replaced, each found exactly once; give the path."""

    def write(*replacements):
        text = GOOD_SCENARIO
        for old, new in replacements:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write

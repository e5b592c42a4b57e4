"""What a unit is called, by whom it is and under what licence; and the names of its features in texts."""

from baryscope.models.scenario import Scenario

DESCRIPTION = (
    "A tumbling target on a Keplerian orbit and a chaser near it: attitude, relative motion, "
    "and the target's features as the chaser sees them"
)
AUTHOR = "The baryscope developers"  # these three as in LICENSE and pyproject.toml
COPYRIGHT = f"Copyright (c) 2026, {AUTHOR}"
LICENCE = "BSD-3-Clause"


def labels_of(scenario: Scenario) -> list[str]:
    """The features' labels; `?` stands for characters that do not show, some of which XML cannot hold."""
    return ["".join(c if c.isprintable() else "?" for c in label) for label in scenario.features.labels]

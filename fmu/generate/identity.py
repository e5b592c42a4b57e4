"""By whom units are, and under what licence."""

AUTHOR = "The baryscope developers"  # these three as in LICENSE and pyproject.toml
COPYRIGHT = f"Copyright (c) 2026, {AUTHOR}"
LICENCE = "BSD-3-Clause"

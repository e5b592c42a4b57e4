"""Burns that nothing told: found in linear `equations` of `poses` by a `search`, and tested in a `solution`."""

"""Burns of the chaser that nothing told: found in linear `equations` by a `search`, and tested in a `solution`."""

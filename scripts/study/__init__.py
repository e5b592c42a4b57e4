"""Studies with simulated tracks: flights, comparisons, campaigns and bounds, for the command line and notebooks."""

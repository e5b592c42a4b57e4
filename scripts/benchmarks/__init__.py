"""Programs that measure: speed and memory against peers, and the screw methods over lags and noise."""

"""Hyperparameters of Gaussian priors: the likeliest by the observations, and the posterior over their uncertainty.

`evidence` has the marginal likelihood and its maximum, by `bounded_minimum` from `scan`s; `integration` what is left of
uncertainty, as a `mixture`. Uses the priors of paths.
"""

"""The free tumble of the body with its Jacobian, and how uncertainties of path and tumble grow away from the tracks.

Evaluates the CasADi expressions of `baryscope.models` and their derivatives numerically.
Uses geometry and paths.
"""

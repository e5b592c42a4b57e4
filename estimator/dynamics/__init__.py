"""Motion models: the path of the centre of mass and the free tumble of the body, each with its Jacobian.

Evaluates the CasADi expressions of `baryscope.models` and their derivatives numerically.
Uses geometry and options.
"""

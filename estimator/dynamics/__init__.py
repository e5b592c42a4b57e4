"""Motion models: the path of the centre of mass and the free tumble of the body, each with its Jacobian.

Numeric evaluation of the CasADi expressions in `baryscope.models`.
Uses geometry.
"""

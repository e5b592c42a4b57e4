"""Least squares of point observations: normal equations, stereo covariance, robust weights, diagnostics.

Shared by all methods that have a covariance.
Uses geometry, registration and dynamics.
"""

"""Least-squares adjustment of point observations, shared by the methods that have a covariance.

Normal equations, stereo covariances, robust weights, removal of spurious information, products of errors,
diagnostics of a result.
Uses geometry, registration, tracks and result.
"""

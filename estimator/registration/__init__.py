"""From tracks to rigid clusters with an attitude in every frame.

Intervals in which features are followed, Procrustes registration, screening of wrong observations, clusters.
Uses geometry.
"""

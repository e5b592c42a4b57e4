"""The sensor: which features are observed when, and the noisy positions that a sensor or a stereo rig measures.

Start with `observe`. `stereo` holds the geometry of the rig, `outliers` the gross errors. `rig` and
`navigation` are the tables and equations of the units StereoRig and CentreOfMassEstimator, which reads the rig.
"""

from baryscope.models.sensor.tracking import Observations, observation_covariance, observe, visible

__all__ = ["Observations", "observation_covariance", "observe", "visible"]

"""The sensor of a run: which features are seen when, and what a position sensor or a stereo rig makes of them.

`observe` is the way in. `stereo` is the rig's geometry, `outliers` what goes wrong beside the noise.
"""

from baryscope.models.sensor.tracking import observation_covariance, observe, visible

__all__ = ["observation_covariance", "observe", "visible"]

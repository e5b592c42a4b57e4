"""From tracks of features to the path of the centre of mass; the arrows name modules in the order of the data.

- screws: tracks → intervals → procrustes → screws of a method → low_pass → intersection → polynomial → result.
- pivot: tracks → screening → clusters → start → refinement → tie_points → unexplained → lack_of_fit
  → joint_covariance → ridge → result.
- ml: pivot → relabelling → initial_tumble → maximum → result.
- ekf: tracks → screening → clusters → initial_tumble → passes → bank → filter → solution → spurious → answer → result.
- score: tracks → screening → clusters → least squares of a fixed centre → result.

Before, camera turns the tracks that are in its axes. Around a fit, noise asks whether the noise is as told, and whether
it changes in time. After it, consider and claims widen what is claimed, where needed. `methods` puts these together.

Rooms with a way in of their own: online (frame by frame), joint (between two bodies), images (tracks of a stereo pair).
"""

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.document.files import write_estimate
from baryscope.estimator.formats import dataset_of_tracks, read_tracks, tracks_of, tracks_of_dataset, write_tracks
from baryscope.estimator.methods import METHODS, Failure, attempt, estimate
from baryscope.estimator.options import PathOptions, ScrewOptions
from baryscope.estimator.prediction import Prediction
from baryscope.estimator.result import Estimate, Status
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.estimator.tracks import FeatureTracks

__all__ = [
    "METHODS",
    "AttitudeSeries",
    "Camera",
    "Estimate",
    "Failure",
    "FeatureTracks",
    "KnownAcceleration",
    "PathOptions",
    "Prediction",
    "Rig",
    "ScrewOptions",
    "Status",
    "attempt",
    "dataset_of_tracks",
    "estimate",
    "read_tracks",
    "tracks_of",
    "tracks_of_dataset",
    "write_estimate",
    "write_tracks",
]

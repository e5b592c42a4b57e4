"""Tracks of features in other people's files and frames; `FeatureTracks.read_csv` has the project's own form.

`read_tracks` goes by the name's ending: .csv, .parquet, .trc and .c3d of motion capture, .nc and .zarr of xarray.
`write_tracks` writes them, `with_marker` puts a centre among them. `tracks_of` takes frames of polars or pandas, or a
dict of columns. Lengths may be in other units than metres.
"""

from baryscope.estimator.formats.dataset import dataset_of_tracks, tracks_of_dataset
from baryscope.estimator.formats.frame import tracks_of
from baryscope.estimator.formats.markers import MARKER_FORMS, with_marker
from baryscope.estimator.formats.read import ENDINGS, read_tracks
from baryscope.estimator.formats.trc import write_trc
from baryscope.estimator.formats.units import METRES, Unit
from baryscope.estimator.formats.write import WRITABLE, refuse_unmarkable, writable, write_tracks, writer_of_tracks

__all__ = [
    "ENDINGS",
    "MARKER_FORMS",
    "METRES",
    "WRITABLE",
    "Unit",
    "dataset_of_tracks",
    "read_tracks",
    "refuse_unmarkable",
    "tracks_of",
    "tracks_of_dataset",
    "with_marker",
    "writable",
    "write_tracks",
    "write_trc",
    "writer_of_tracks",
]

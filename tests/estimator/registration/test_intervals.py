import numpy as np

from baryscope.estimator.registration.intervals import find_intervals, runs_of
from baryscope.estimator.tracks import FeatureTracks


def tracks_of(seen, time=None):
    seen = np.asarray(seen, dtype=bool)
    position = np.where(seen[..., None], 1.0, np.nan) * np.ones(3)
    time = np.arange(len(seen), dtype=float) if time is None else time
    return FeatureTracks(time, position, tuple(f"F{i}" for i in range(seen.shape[1])))


def spans(tracks):
    return [(interval.start, interval.stop) for interval in find_intervals(tracks)]


def frame_by_frame(tracks):
    """The rule of `find_intervals`, applied frame by frame."""
    seen, found, start = tracks.seen, [], None
    step = np.median(np.diff(tracks.time))
    for k in range(len(seen)):
        gap = k > 0 and tracks.time[k] - tracks.time[k - 1] > 1.5 * step
        enough = seen[k].sum() >= 3
        if start is not None:
            common = (seen[start] & seen[k]).sum()
            if gap or not enough or common < max(3, seen[start].sum() / 2):
                found.append((start, k))
                start = None
        if start is None and enough:
            start = k
    return found if start is None else [*found, (start, len(seen))]


def test_blackouts_gaps_and_new_clusters_end_an_interval():
    seen = np.ones((12, 4), dtype=bool)
    seen[4:6, 1:] = False  # a blackout: one feature only
    time = np.arange(12.0)
    time[9:] += 1.0
    assert spans(tracks_of(seen, time)) == [(0, 4), (6, 9), (9, 12)]
    seen = np.zeros((10, 8), dtype=bool)
    seen[:5, :4] = seen[5:, 4:] = True
    seen[5:, 0] = True
    found = find_intervals(tracks_of(seen))
    assert [(i.start, i.stop, i.features) for i in found] == [(0, 5, (0, 1, 2, 3)), (5, 10, (0, 4, 5, 6, 7))]


def test_flicker_of_few_features_does_not_end_an_interval():
    seen = np.ones((6, 8), dtype=bool)
    seen[3, :4] = False
    assert spans(tracks_of(seen)) == [(0, 6)]
    seen[3, 4] = False
    assert spans(tracks_of(seen)) == [(0, 3), (3, 6)]


def test_intervals_agree_with_the_frame_by_frame_rule():
    rng = np.random.default_rng(5)
    for _ in range(100):
        n = int(rng.integers(2, 400))
        seen = rng.random((n, 6)) < rng.uniform(0.4, 1)
        time = np.cumsum(rng.choice([1.0, 1.2, 2.0], n, p=[0.9, 0.08, 0.02]))
        tracks = tracks_of(seen, time)
        assert spans(tracks) == frame_by_frame(tracks)


def test_a_single_frame_and_no_observations():
    assert spans(tracks_of(np.ones((1, 3)))) == [(0, 1)]
    assert spans(tracks_of(np.zeros((3, 3)))) == []


def test_runs_of_true():
    rows = np.array([True, False, False, True, True, False, True])
    assert runs_of(rows).tolist() == [[0, 1], [3, 5], [6, 7]]
    assert runs_of(np.zeros(3, dtype=bool)).tolist() == []
    assert runs_of(np.ones(2, dtype=bool)).tolist() == [[0, 2]]

"""Options of the command line for where the target is and how the camera looks at it: orbit, UTC, attitude, rig."""

from dataclasses import dataclass, replace
from pathlib import Path

from cyclopts import Parameter

from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.ephemeris.utc import utc_of, utc_text
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit
from baryscope.models.scenario import load_orbit


@dataclass(frozen=True, eq=False)
class Frames:
    """What is known of the frames of tracks: the UTC of time 0 in ISO 8601, the target's orbit, the camera."""

    epoch: str | None
    orbit: Orbit | None
    camera: Camera | None

    def dated(self, tracks: FeatureTracks) -> FeatureTracks:
        """The tracks with the epoch, where the camera's attitude is at UTC times and needs it."""
        if self.camera is None or self.camera.attitude.epoch is None:
            return tracks
        return replace(tracks, epoch=self.epoch)

    def inertial(self, tracks: FeatureTracks) -> FeatureTracks:
        """The tracks in C: as they are without a camera."""
        return tracks if self.camera is None else self.camera.inertial(tracks)


@Parameter(name="*")
@dataclass(frozen=True)
class FrameChoices:
    """Orbit, UTC of time 0, and camera.

    Parameters
    ----------
    orbit
        The target's orbit: a TOML file with a table [orbit], which `baryscope simulate` writes beside its tracks, or a
        TLE, OMM or OEM. The axes of the tracks are those of the orbit: TEME for a TLE or OMM.
    orbit_accuracy
        Standard deviation of the target's place along --orbit and across it, m; 0: exact. Default: what the file tells;
        if it tells nothing, as an OEM, an error is allowed for where the tracks do not exclude it.
    epoch
        UTC of time 0, for a TLE, OMM, OEM, an orbit with an epoch, or a camera's attitude at UTC times. Default: that
        of tracks with UTC times.
    camera
        The camera's attitude, for tracks in camera axes: a CSV file with the columns time,qw,qx,qy,qz (s or UTC, unit
        quaternions, the scalar first) that turn camera axes into inertial ones. Rows span the tracks without gaps.
    rig
        Of --camera: a TOML file with a table [rig], the lever arm from the chaser's centre of mass to the camera, and
        what is uncertain about camera and attitude. Default: no lever arm, nothing uncertain.
    """

    orbit: Path | None = None
    orbit_accuracy: float | None = None
    epoch: str | None = None
    camera: Path | None = None
    rig: Path | None = None

    def check(self, others: bool) -> None:
        """Check the options before anything is read; others: whether a file beside these may have UTC times.

        Raises:
            InputError: a rig without a camera, an accuracy without an orbit, an epoch that is no UTC, or one that
                nothing needs.
        """
        if self.orbit_accuracy is not None and self.orbit is None:
            raise InputError("--orbit-accuracy: needs the target's orbit, expected --orbit ORBIT")
        if self.rig is not None and self.camera is None:
            raise InputError("--rig: needs the camera's attitude, expected --camera ATTITUDE.csv")
        if self.epoch is not None:
            utc_of(self.epoch, "--epoch")
            if self.orbit is None and self.camera is None and not others:
                raise InputError(
                    "--epoch: needs something that has a UTC, expected --orbit ORBIT, --acceleration A.csv, "
                    "--camera ATTITUDE.csv or --predict-at TIMES.csv"
                )

    def files(self) -> list[Path]:
        """The files that are read."""
        return [file for file in (self.orbit, self.camera, self.rig) if file is not None]

    def read(self, tracks: FeatureTracks) -> Frames:
        """Orbit and camera from their files, and the epoch, as given or by the tracks.

        Raises:
            InputError: a file is wrong, option and tracks both give the epoch, or the attitude lacks a time of theirs.
        """
        epoch = self._epoch_of(tracks)
        orbit = self._orbit(epoch)
        if self.camera is None:
            return Frames(epoch, orbit, None)
        camera = Camera.load(_csv(self.camera), self.rig)
        found = Frames(epoch, orbit, camera)
        dated = found.dated(tracks)
        try:
            camera.attitude.at(dated.time, dated.epoch)
        except InputError as error:
            raise InputError(f"{self.camera}: {error}") from error
        return found

    def _orbit(self, epoch: str | None) -> Orbit | None:
        """The orbit from its file, as exact as the command line tells; epoch: UTC of time 0, if known.

        Raises:
            InputError: the file or the accuracy is wrong.
        """
        if self.orbit is None:
            return None
        orbit = load_orbit(self.orbit, epoch)
        if self.orbit_accuracy is None:
            return orbit
        try:
            return replace(orbit, accuracy=self.orbit_accuracy)
        except InputError as error:
            raise InputError(f"--orbit-accuracy: {error}") from error

    def _epoch_of(self, tracks: FeatureTracks) -> str | None:
        """The UTC of time 0 in ISO 8601, as given on the command line or by the tracks.

        Raises:
            InputError: both give it.
        """
        if self.epoch is not None and tracks.epoch is not None:
            raise InputError(f"--epoch: found {self.epoch} beside tracks with UTC times, expected one of the two")
        return tracks.epoch if self.epoch is None else utc_text(utc_of(self.epoch, "--epoch"))


def _csv(path: Path) -> Path:
    """A path of a CSV file.

    Raises:
        InputError: its name doesn't end in .csv.
    """
    if path.suffix != ".csv":
        raise InputError(f"{path}: ends in {path.suffix!r}, expected .csv")
    return path

"""`baryscope fly`: the closed loop, on estimates alone."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from baryscope.fmu.system import build_system, refuse_step
from baryscope.models.errors import InputError
from baryscope.models.files import check_outputs, temporary_folder
from baryscope.models.scenario import load_scenario, scenario_path
from baryscope.progress import Progress, stage
from baryscope.scripts.cli.console import UNTRUSTED, Show
from baryscope.study.loop import Loop, fly_loop
from baryscope.study.loop_files import REPORT, loop_paths, write_loop
from baryscope.study.loop_summary import summary_of


def fly(
    system: Annotated[Path | None, Parameter(name="CHAIN")] = None,
    *,
    scenario: str | None = None,
    controller: Path | None = None,
    duration: float | None = None,
    step: float | None = None,
    approach: Annotated[bool, Parameter(negative=())] = False,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> int:
    """Fly target, rig, estimator and controller as one loop, on estimates alone; write what was measured and estimated.

    The exit code is 3 if at last the estimator does not track the target, as it starts, doubts its estimate or is lost,
    or if the chaser retreats.

    Parameters
    ----------
    system
        A system that `baryscope system` wrote, CHAIN.ssp, perhaps with other parameters. Default: that of --scenario.
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml. [default: envisat]
    controller
        Another tool's FMU in the place of ApproachController, as of `baryscope system`.
    duration
        How long to fly, s. Default: that of the scenario.
    step
        From one communication point to the next, s. What the chaser does is late by two. Default: the units' own.
    approach
        Once the target's tumble is known, glide to 2 m before its first feature, and stay there as it turns. Else the
        chaser holds where it starts.
    output
        Folder for tracks.csv (beside it tracks.orbit.toml and tracks.acceleration.csv, the commands in LVLH, as
        `baryscope estimate` takes them), truth.csv, estimate.csv, flight.json, report.html (the scene in 3D, the
        estimate's convergence and its residuals, for a browser) and flight.png. Default: the scenario's or the
        system's name, followed by -flight.
    """
    show = show or Show()
    if system is not None and scenario is not None:
        raise InputError(f"{system} and --scenario {scenario}: found two, expected a system or a scenario")
    if system is not None and controller is not None:
        raise InputError(f"{system} and --controller {controller}: found two, but the system has a controller already")
    _refuse_times(duration, step)
    name = scenario or "envisat"
    flown = load_scenario(name) if system is None else None
    folder = output or Path(f"{flown.name if flown else Path(str(system)).stem}-flight")
    read = (system, controller, scenario_path(name))
    check_outputs(loop_paths(folder), [path for path in read if path is not None])
    with show.progress() as progress:

        def flight(archive: Path, progress: Progress | None) -> Loop:
            return fly_loop(archive, duration=duration, step=step, approach=approach, progress=progress)

        if system is not None:
            loop = flight(system, progress)
        else:
            assert flown is not None  # noqa: S101  there is a scenario without a system
            with temporary_folder() as place:
                with stage(progress, "building the units") as share:
                    archive = place / "chain.ssp"
                    build_system(flown, archive, controller=controller, progress=lambda _, done: share(done))
                loop = flight(archive, progress)
        options = {"of": str(system or name), "duration": duration, "step": step, "approach": approach}
        options |= {} if controller is None else {"controller": str(controller)}
        with stage(progress, "writing"):
            files = write_loop(loop, folder, options)
    found = summary_of(loop)
    words = [*_words(found), f"report, for a browser: {folder / REPORT}", f"files in {folder}"]
    show.result(found | {"files": [str(path) for path in files]}, *words)
    return 0 if found["status"] == "tracking" and found["retreating_since"] is None else UNTRUSTED


def _refuse_times(duration: float | None, step: float | None) -> None:
    """Check duration and step, s, as far as they can be without the units, whose building may take a minute.

    Raises:
        InputError: there is no flight of that duration in steps of that size.
    """
    refuse_step(step)
    least = step or 0.0
    if duration is not None and not (duration > 0 and duration >= least):
        expected = f"{least:g} s, a step, or more" if step else "more than 0 s"
        raise InputError(f"duration: found {duration:g} s, expected {expected}")


def _words(found: dict[str, Any]) -> list[str]:
    """A flight in a few lines."""
    lines = [f"{found['duration']:.0f} s in steps of {found['step']:g} s, {found['samples']} samples of the rig"]
    if found["tracking_since"] is None:
        lines.append(f"the estimator never tracked the target: it is {found['status']}")
    else:
        lines += _tracked(found)
    if found["inside"]:
        lines.append(
            f"inside the convex hull of the features for {found['inside']:.3g} s, since {found['inside_since']:.0f} s: "
            "it may have hit the target"
        )
    return lines


def _tracked(found: dict[str, Any]) -> list[str]:
    """A flight of an estimator that tracked the target, in lines."""
    lines = []
    tumble = found["tumble_known_since"]
    lines.append(
        f"tracking since {found['tracking_since']:.0f} s, "
        + ("tumble not known" if tumble is None else f"tumble known since {tumble:.0f} s")
    )
    if found["untracked"]:
        since = found["untracked_since"]
        at_last = "" if since is None else f", at last since {since:.0f} s; the estimator is {found['status']}"
        nothing = ": the controller is told nothing" if found["reckoned"] is None else ""
        lines.append(f"not tracking for {found['untracked']:.3g} s after that{nothing}{at_last}")
    if found["reckoned"] or found["retreated"]:
        since = found["retreating_since"]
        at_last = "" if since is None else f", at last since {since:.0f} s"
        lines.append(
            f"without navigation: dead reckoning for {found['reckoned']:.3g} s, retreat for {found['retreated']:.3g} s"
            + at_last
        )
    if found["position_rmse"] is not None:
        lines.append(
            f"second half: centre of mass within {1e3 * found['position_rmse']:.3g} mm rms, claimed "
            f"{1e3 * found['claimed_rmse']:.3g} mm, NEES {found['mean_nees']:.2f} (3 expected)"
        )
    lines.append(
        f"while tracking: NEES at most {found['largest_nees']:.3g}, claims too small for "
        f"{100 * found['wrong_share']:.3g} % of the time"
    )
    goal = "its place" if found["synchronised_since"] is None else "the point before the feature"
    lines += [
        f"last tenth: chaser at most {found['largest_miss']:.3g} m from {goal}",
        f"nearest {found['nearest']:.3g} m to the centre of mass, {found['nearest_feature']:.3g} m to a feature",
        f"commands of {found['velocity_change']:.3g} m/s in all",
    ]
    return lines

"""`baryscope build`: the co-simulation unit of a scenario."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from baryscope import __version__
from baryscope.fmu import build_fmu
from baryscope.fmu.generate import build_wasm
from baryscope.models.errors import InputError
from baryscope.models.files import check_outputs
from baryscope.models.scenario import load_scenario, scenario_path
from baryscope.progress import stage
from baryscope.scripts.cli.console import Show


def build(
    *,
    scenario: str = "envisat",
    unit: Literal["target", "rig", "estimator", "controller"] = "target",
    fmi: Literal[2, 3] = 2,
    platforms: Literal["host", "linux", "all", "wasm"] = "host",
    scalar: Annotated[bool, Parameter(negative=())] = False,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Build a co-simulation unit (FMU) of a scenario, for this machine or others; the target has Model Exchange, too.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    unit
        `target`: the tumbling target and the motion of the chaser, TumblingTarget. `rig`: a pair of cameras that sees
        the target's features, StereoRig. `estimator`: finds the target's centre of mass in what the rig sees,
        CentreOfMassEstimator. `controller`: flies the chaser to the target, ApproachController.
    fmi
        Version of FMI: 2 for 2.0, 3 for 3.0.
    platforms
        `host`: this machine, and those with the same C library or a later one. `linux`: x86-64 and aarch64 with glibc
        2.17 or later. `all`: these, macOS on both and Windows on x86-64, in one FMU. `wasm`: a WebAssembly module and
        a table of its variables, FILE.json, instead of an FMU. All but `host` need `pip install 'baryscope[cross]'`;
        the first build with `all` takes a few minutes.
    scalar
        One variable for each scalar in FMI 3, for importers that cannot read arrays. FMI 2 has no arrays.
    output
        The FMU to write. Default: the scenario's name, followed by -rig, -estimator or -controller for these, with .fmu
        (.wasm for `wasm`).
    """
    show = show or Show()
    flown = load_scenario(scenario)
    suffix = ".wasm" if platforms == "wasm" else ".fmu"
    path = output or Path(f"{flown.name}{'' if unit == 'target' else f'-{unit}'}{suffix}")
    if path.suffix != suffix:
        raise InputError(f"{path}: ends in {path.suffix!r}, expected {suffix}")
    if platforms == "wasm" and fmi != 2:
        raise InputError(f"--fmi {fmi}: the WebAssembly module is of FMI 2, expected --fmi 2")
    written = [path, path.with_suffix(".json")] if platforms == "wasm" else [path]
    check_outputs(written, [scenario_path(scenario)])
    with show.progress() as progress, stage(progress, "building the unit") as share:

        def compiling(left: tuple[str, ...], done: float) -> None:
            share(done)
            if left and platforms != "host":
                show.remark(f"compiling for {', '.join(left)}")

        if platforms == "wasm":
            build_wasm(flown, path, unit=unit, progress=compiling)
        else:
            build_fmu(flown, path, unit=unit, fmi=fmi, scalar=scalar, platforms=platforms, progress=compiling)
    features, size = len(flown.features.points), path.stat().st_size
    data = {"version": __version__, "file": str(path), "fmi": fmi, "features": features, "bytes": size}
    show.result(data, f"{path}: {features} features, {size / 1000:.0f} kB")

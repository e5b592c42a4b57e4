"""Speed and memory of the unit, the session and the estimator, as ratios to peers measured in the same run.

    make benchmark        or        python scripts/benchmarks/benchmark.py [--peers all|NAME,…]

Peers: fmpy's own `simulate_fmu`, scipy's DOP853, CasADi's cvodes, one call of scipy's `Rotation.align_vectors` a frame,
scipy's `least_squares`, a Kalman filter in numpy; and, where they are installed (pip install -e '.[bench]'), heyoka,
Basilisk, GTSAM and a pythonfmu unit of the same model. The least squares of `pivot` are compared without and with
process noise.
Accuracies are measured against the closed forms of the tests: Jacobi's functions with one quadrature for the
attitude, the difference of two Kepler orbits for the position. With J2, drag and gravity gradient the unit must be
where Basilisk is. Times are the best of several runs.

Exit code 1 if a result is wrong: errors above their tolerances, peers that disagree, or a peer that --peers names and
that is not installed. Times are printed and never judged.
"""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
from collections.abc import Callable, Mapping, Sequence  # noqa: E402
from functools import partial  # noqa: E402
from pathlib import Path  # noqa: E402

from rich.console import Console  # noqa: E402

from baryscope import __version__  # noqa: E402
from baryscope.models.scenario import load_scenario  # noqa: E402
from baryscope.progress import stage  # noqa: E402
from baryscope.scripts.benchmarks.adjusting import DENSITY, adjusting  # noqa: E402
from baryscope.scripts.benchmarks.estimating import estimating, reading  # noqa: E402
from baryscope.scripts.benchmarks.flying import flying  # noqa: E402
from baryscope.scripts.benchmarks.orbit import whole_orbit  # noqa: E402
from baryscope.scripts.benchmarks.report import Part, rows_table  # noqa: E402
from baryscope.scripts.benchmarks.setting import PEERS, Setting, installed_peers  # noqa: E402
from baryscope.scripts.benchmarks.stepping import stepping  # noqa: E402
from baryscope.scripts.benchmarks.under_forces import under_forces  # noqa: E402
from baryscope.scripts.cli.console import Show, out  # noqa: E402
from baryscope.study import build_unit  # noqa: E402

PARTS: Mapping[str, Callable[[Setting], Part]] = {
    "stepping": stepping,
    "reading tables": reading,
    "estimating": estimating,
    "frame by frame": flying,
    "the same least squares": adjusting,
    "the same with process noise": partial(adjusting, density=DENSITY),
    "one orbit in one step": whole_orbit,
    "forces": under_forces,
}


def main(arguments: Sequence[str] | None = None, parts: Mapping[str, Callable[[Setting], Part]] = PARTS) -> int:
    """Measure and print.

    Returns:
        0, or 1 if a result is wrong or a peer that was asked for is missing.
    """
    asked, present = _asked(arguments), installed_peers()
    faults = [f"{peer}: is not installed, expected it by --peers" for peer in sorted((asked or frozenset()) - present)]
    scenario = load_scenario("envisat")
    results = []
    with tempfile.TemporaryDirectory(prefix="baryscope-") as name, Show().progress() as progress:
        folder = Path(name)
        unit = build_unit(scenario, folder / "unit.fmu", progress)
        setting = Setting(scenario, unit, folder, present if asked is None else asked & present)
        for title, part in parts.items():
            with stage(progress, title):
                results.append(part(setting))
    faults += [fault for result in results for fault in result.faults]
    table = rows_table([row for result in results for row in result.rows], f"baryscope {__version__}, {sys.platform}")
    others = [table for result in results for table in result.tables]
    Console(width=max(out.width, 125), highlight=False).print(table, *others)
    for fault in faults:
        print(f"wrong: {fault}", file=sys.stderr)
    return 1 if faults else 0


def _asked(arguments: Sequence[str] | None) -> frozenset[str] | None:
    """The optional peers that the command line names; None for those that happen to be installed."""
    parser = argparse.ArgumentParser(
        description="Measure baryscope beside its peers; exit code 1 if a result is wrong."
    )
    names = ", ".join(PEERS)
    parser.add_argument("--peers", help=f"all, or some of {names}, which must then be installed")
    text = parser.parse_args(arguments).peers
    if text is None:
        return None
    chosen = frozenset(PEERS) if text == "all" else frozenset(name.strip() for name in text.split(","))
    unknown = chosen - set(PEERS)
    if unknown:
        parser.error(f"--peers: found {', '.join(sorted(unknown))}, expected all or some of {names}")
    return chosen


if __name__ == "__main__":
    sys.exit(main())

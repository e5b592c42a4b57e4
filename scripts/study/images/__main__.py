"""`python -m baryscope.study.images run | report | write | picture`: see docs/images.md."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import sys  # noqa: E402
from functools import partial  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import TextIO  # noqa: E402

from baryscope.models.files import write_together  # noqa: E402
from baryscope.models.scenario import orbit_text  # noqa: E402
from baryscope.study.images.judging import judged, prepared  # noqa: E402
from baryscope.study.images.picture import picture  # noqa: E402
from baryscope.study.images.report import table  # noqa: E402
from baryscope.study.images.scene import NOISE, Scene, Setting, drawn, rig_text, write_images  # noqa: E402
from baryscope.study.pictures import save  # noqa: E402
from baryscope.study.population import command  # noqa: E402

METHODS = ("pivot", "ml")


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if it could do what it is asked for."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.study.images", description=__doc__)
    commands = parser.add_subparsers(required=True)
    runner = command.add_run(commands, "seeds", METHODS, METHODS, 600.0)
    runner.add_argument("--seeds", type=command.natural, default=12, help="from --seed on")
    _add_setting(runner)
    runner.set_defaults(run=_run)
    command.add_report(commands, "the table").set_defaults(run=_report)
    files = "rig.toml, attitude.csv, orbit.toml and truth.csv"
    writer = commands.add_parser("write", help=f"the images of a draw, with {files}")
    writer.set_defaults(run=_write)
    painter = commands.add_parser("picture", help="the last left image of a draw, with what is followed, as PNG")
    painter.set_defaults(run=_paint)
    for one in (writer, painter):
        one.add_argument("--seed", type=command.natural, default=1)
        one.add_argument("-o", "--output", type=Path, required=True)
        _add_setting(one)
    return command.executed(parser, arguments)


def _add_setting(parser: argparse.ArgumentParser) -> None:
    usual = Setting()
    parser.add_argument("--duration", type=float, default=usual.duration, help="s")
    parser.add_argument("--rate", type=float, default=usual.rate, help="pairs a second")
    parser.add_argument("--noise", type=float, default=NOISE, help="of a pixel, in steps of 8 bits")
    parser.add_argument("--width", type=command.positive, default=usual.width, help="of the images, px")


def _run(options: argparse.Namespace) -> None:
    setting = (options.duration, options.rate, options.width, options.noise)
    seeds = range(options.seed, options.seed + options.seeds)
    groups = [[(seed, method, *setting) for method in options.methods] for seed in seeds]
    command.fill(options, judged, ("seed", "method", "duration", "rate", "width", "noise"), groups)


def _report(options: argparse.Namespace) -> None:
    print(table(command.reported(options)).markdown())


def _write(options: argparse.Namespace) -> None:
    scene = drawn(options.seed, Setting(options.duration, options.rate, options.width, options.noise))
    write_images(scene, options.output)
    texts = {"rig.toml": rig_text(scene), "attitude.csv": _attitude(scene), "truth.csv": _truth(scene)}
    texts["orbit.toml"] = orbit_text(scene.orbit.of_simulation())
    write_together({options.output / name: partial(_put, text) for name, text in texts.items()})


def _paint(options: argparse.Namespace) -> None:
    setting = Setting(options.duration, options.rate, options.width, options.noise)
    save(picture(*prepared(options.seed, setting)), options.output)


def _put(text: str, stream: TextIO) -> None:
    stream.write(text)


def _attitude(scene: Scene) -> str:
    rows = zip(scene.time.tolist(), scene.camera.attitude.quaternion.tolist(), strict=True)
    return "time,qw,qx,qy,qz\n" + "".join(f"{time},{','.join(map(repr, values))}\n" for time, values in rows)


def _truth(scene: Scene) -> str:
    rows = zip(scene.time.tolist(), scene.path.tolist(), strict=True)
    return "time,x,y,z\n" + "".join(f"{time},{','.join(map(repr, values))}\n" for time, values in rows)


if __name__ == "__main__":
    sys.exit(main())

"""The recipe for SLURM in docs/campaign.md, on an `sbatch` that starts jobs on this machine."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest
from dask.utils import parse_timedelta

from baryscope.study.campaign.folder import RUNS
from documents import fences

pytest.importorskip("dask_jobqueue", reason="needs dask-jobqueue (baryscope[test])")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="SLURM's jobs are shell scripts")

# Stands in for SLURM's: a job is a session of its own, whose number is that of its first process.
SBATCH = """\
#!{python}
import pathlib, shutil, subprocess, sys
jobs = pathlib.Path(__file__).parent
script = jobs / f"job{{len(list(jobs.glob('job*.pid'))) + 1}}"
shutil.copy(sys.argv[-1], script)
quiet = subprocess.DEVNULL
job = subprocess.Popen(["bash", script], start_new_session=True, stdin=quiet, stdout=quiet, stderr=quiet)
(jobs / f"{{script.name}}.pid").write_text(str(job.pid))
print("Submitted batch job", job.pid)
"""
SCANCEL = "#!/bin/sh\nkill -9 -- -$1\n"
DRAWS = 25  # of some 50 ms each: more than are done when a job ends that has done two


@pytest.fixture
def slurm(tmp_path):
    """A folder with the two programs, and an environment that has them, and the recipe's place of this program."""
    for name, text in (("sbatch", SBATCH.format(python=sys.executable)), ("scancel", SCANCEL)):
        (tmp_path / name).write_text(text, encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    home = tmp_path / "home"  # not where programs start, as Python would take its folder for the package
    activate = home / "baryscope" / ".venv" / "bin" / "activate"
    activate.parent.mkdir(parents=True)
    activate.write_text(f'PATH="{os.path.dirname(sys.executable)}:$PATH"\n', encoding="utf-8")  # noqa: PTH120
    path = f"{tmp_path}{os.pathsep}/usr/bin{os.pathsep}/bin"  # without this program's Python
    yield (
        tmp_path,
        os.environ
        | {
            "HOME": str(home),
            "PATH": path,
            "OPENBLAS_NUM_THREADS": "1",
            "DASK_DISTRIBUTED__ADAPTIVE__INTERVAL": "500ms",
            "DASK_DISTRIBUTED__DEPLOY__LOST_WORKER_TIMEOUT": "100ms",
        },
    )
    for file in tmp_path.glob("job*.pid"):
        with suppress(ProcessLookupError):
            os.killpg(int(file.read_text(encoding="utf-8")), signal.SIGKILL)


def recipe():
    (found,) = (block for _, block in fences("docs/campaign.md")[0] if "SLURMCluster(" in block)
    return found


def changed(text, *changes):
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def test_the_recipe_s_jobs_end_before_slurm_ends_them(slurm):
    """The script that is printed: one that bash takes, with a worker of one thread by the Python of the prologue."""
    folder, environment = slurm
    begin = recipe()[: recipe().index("cluster.adapt(")]
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", begin + "cluster.close()\n"],
        cwd=folder, env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    script = run.stdout
    subprocess.run(["bash", "-n"], input=script, text=True, check=True)  # noqa: S607
    assert script.index("activate") < script.index("\npython -m distributed.cli.dask_worker tcp://")
    options = dict(re.findall(r"--([a-z-]+) (\S+)", script[script.index("dask_worker") :]))
    assert [options["nthreads"], options.get("nworkers", "1")] == ["1", "1"]
    hours, minutes, seconds = map(int, re.search(r"#SBATCH -t (\d+):(\d+):(\d+)", script).groups())
    longest = sum(parse_timedelta(options[name]) for name in ("lifetime", "lifetime-stagger"))
    assert longest + 60 < 3600 * hours + 60 * minutes + seconds  # a minute to start, and to hand on
    assert not list(folder.glob("job*"))


def test_a_campaign_outlasts_its_jobs(slurm, scenario_file):
    """One job at a time instead of 320, whose node fails in the middle: another one is submitted, and goes on."""
    folder, environment = slurm
    program = changed(
        recipe(),
        ("minimum_jobs=320, maximum_jobs=320", "minimum_jobs=1, maximum_jobs=1"),
        ('suite="ranges", draws=100_000', f'[{str(scenario_file)!r}], methods=["score"], draws={DRAWS}'),
    )
    lines = folder / "out" / "ranges" / RUNS
    process = subprocess.Popen([sys.executable, "-c", program], cwd=folder, env=environment)
    try:
        while not (lines.exists() and lines.read_bytes().count(b"\n") >= 2):
            assert process.poll() is None
            time.sleep(0.01)
        os.killpg(int((folder / "job1.pid").read_text(encoding="utf-8")), signal.SIGKILL)
        assert process.wait(timeout=300) == 0
    finally:
        process.kill()
        process.wait()
    found = [json.loads(line)["case"] for line in lines.read_text(encoding="utf-8").splitlines()]
    assert sorted(found) == list(range(DRAWS))
    assert (folder / "job2").exists()

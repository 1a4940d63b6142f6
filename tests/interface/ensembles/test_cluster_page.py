"""The batch scripts of `docs/howto/cluster.md`, run in a small form: twelve members of a small sail, two
processes, and a stand-in for SLURM's commands."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from esail_jax.ensembles import load_ensemble
from support.small_ensemble import SMALL, same

TEXT = (Path(__file__).parents[3] / "docs" / "howto" / "cluster.md").read_text(encoding="utf-8")
SCRIPTS = {
    title: script
    for title, script in re.findall(
        r"^## (SLURM, [^\n]*)\n.*?```shell\n(#!/bin/bash\n.*?)```", TEXT, re.S | re.M
    )
}

COMMANDS = {
    # Two tasks of an MPI job, or one of anything else.
    "srun": 'case "$*" in *mpi4py*) exec mpiexec -n 2 "$@" ;; *) exec "$@" ;; esac',
    "scontrol": 'echo "$@" >> requeued',
}


def surroundings(folder):
    """A folder with SLURM's commands, and the environment in which they are found."""
    commands = folder / "bin"
    commands.mkdir()
    for name, body in COMMANDS.items():
        path = commands / name
        path.write_text(f"#!/bin/bash\n{body}\n")
        path.chmod(path.stat().st_mode | stat.S_IEXEC)
    own = Path(sys.executable).parent
    python_path = os.pathsep.join(filter(None, sys.path))
    return os.environ | {
        "PATH": os.pathsep.join([str(commands), str(own), os.environ["PATH"]]),
        "PYTHONPATH": python_path,
        "SLURM_JOB_ID": "7",
    }


def small(script):
    """The script with a small ensemble, that keeps the programs where all tests do."""
    settings = " ".join(f"--set {key}={value}" for key, value in SMALL.items())
    script = re.sub(r"^export ESAIL_CACHE=.*$", "", script, flags=re.M)
    script, found = re.subn(r"--members 10000", f"--members 12 {settings} --quiet", script)
    assert found == 1
    return script


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """What each script has computed, and whether it asked for another start."""
    found = {}
    for title, script in SCRIPTS.items():
        folder = tmp_path_factory.mktemp("job")
        (folder / "job.sh").write_text(small(script))
        done = subprocess.run(
            ["bash", "job.sh"],
            cwd=folder,
            env=surroundings(folder),
            capture_output=True,
            text=True,
            timeout=600,
        )
        assert (folder / "many" / "ensemble.h5").exists(), done.stderr
        found[title] = (load_ensemble(folder / "many" / "ensemble.h5"), (folder / "requeued").exists())
    return found


@pytest.mark.nightly
def test_every_script_gives_the_same_ensemble(results):
    """One node, MPI and Dask compute the same members, bit for bit, and none asks for another start."""
    assert list(results) == [
        "SLURM, one node",
        "SLURM, many nodes, with MPI",
        "SLURM, many nodes, with Dask",
    ]
    first = results["SLURM, one node"][0]
    for ensemble, requeued in results.values():
        assert ensemble.complete.all() and not requeued and same(ensemble, first)


@pytest.mark.nightly
def test_a_script_that_was_interrupted_asks_for_another_start(tmp_path):
    """A command that ends with 130 puts the job into the queue again, and the next start completes it; bad
    input does not."""
    script = small(SCRIPTS["SLURM, one node"])
    environment = surroundings(tmp_path)
    (tmp_path / "bin" / "srun").write_text("#!/bin/bash\nexit ${CODE:-0}\n")
    for code, requeued in ((0, False), (2, False), (130, True)):
        (tmp_path / "requeued").unlink(missing_ok=True)
        subprocess.run(
            ["bash", "-c", script], cwd=tmp_path, env=environment | {"CODE": str(code)}, check=True
        )
        assert (tmp_path / "requeued").exists() == requeued

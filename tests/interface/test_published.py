"""What is published: a wheel and a source archive that hold the files of the project and nothing else."""

import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

import esail_jax as esail

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    """The wheel and the source archive, built from this tree."""
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-d", folder], cwd=ROOT, check=True)
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source


@pytest.fixture(scope="module")
def tracked():
    """The files under version control."""
    if not (ROOT / ".git").exists():
        pytest.skip("a tree without version control")
    found = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    return {name for name in found.stdout.split("\0") if name and (ROOT / name).exists()}


def test_the_wheel_has_the_packages_and_nothing_else(archives, tracked):
    """Every file of the two packages, data included, but no tests."""
    wheel, _ = archives
    inside = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    packages = {name for name in tracked if name.startswith(("esail_jax/", "kept_programs/"))}
    assert inside == {name for name in packages if not name.startswith("kept_programs/tests/")}
    assert wheel.name.startswith(f"esail_jax-{esail.__version__}-py3-none-any")


def test_the_source_has_the_files_under_version_control(archives, tracked):
    _, source = archives
    root = f"esail_jax-{esail.__version__}/"
    with tarfile.open(source) as archive:
        inside = {x.name.removeprefix(root) for x in archive.getmembers() if x.isfile()}
    assert inside - {"PKG-INFO"} == tracked


def test_a_wheel_in_a_fresh_environment(archives, tmp_path):
    """Installed with what it needs and nothing else, it runs the baseline and computes a gradient, which is
    the difference quotient to 1e-5: that of a quotient with a step of 1e-6 of 4e-3."""
    venv.create(tmp_path / "fresh", with_pip=True)
    scripts = tmp_path / "fresh" / ("Scripts" if os.name == "nt" else "bin")
    clean = {
        name: value for name, value in os.environ.items()
        if name not in ("PYTHONPATH", "JAX_ENABLE_X64", "XLA_FLAGS")
    }  # fmt: skip

    def run(*command):
        return subprocess.run(
            [scripts / command[0], *command[1:]], cwd=tmp_path, env=clean, check=True, text=True,
            capture_output=True,
        ).stdout  # fmt: skip

    run("python", "-m", "pip", "install", "-q", "--disable-pip-version-check", archives[0])
    run("esail", "run", "baseline", "--set", "integrator.t_end=100", "-o", "baseline.h5")
    assert (tmp_path / "baseline.h5").exists()
    said = run("python", "-P", ROOT / ".ci" / "try_wheel.py")
    assert str(tmp_path / "fresh") in said and "gradient" in said

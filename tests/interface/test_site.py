"""The documentation site: it is built without a warning, its tables come from the package, and its examples
run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import esail_jax as esail
from esail_jax import observables
from esail_jax.cli import main
from esail_jax.scenes.key_reference import describe_keys
from support.small_ensemble import arguments

ROOT = Path(__file__).parents[2]

PAGES = sorted(
    path
    for path in (ROOT / "docs").rglob("*.md")
    if "generated" not in path.parts and "```python" in path.read_text(encoding="utf-8")
)
"""Pages with examples in Python."""


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    """A warning is an error: a link to a page that does not exist, or a picture that is missing. Every key
    of a scene and every observable has its row."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", tmp_path / "trees"]
    done = subprocess.run([*command, ROOT / "docs", tmp_path / "site"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    keys = (tmp_path / "site" / "generated" / "keys.html").read_text(encoding="utf-8")
    assert all(f">{key.name}<" in keys for key in describe_keys())
    rows = (tmp_path / "site" / "generated" / "observables.html").read_text(encoding="utf-8")
    entries = (*observables.sail.OBSERVABLES, *observables.sail.ON_REQUEST, *observables.chain.OBSERVABLES)
    assert all(f">{entry.name}<" in rows for entry in entries)
    python = (tmp_path / "site" / "reference" / "python.html").read_text(encoding="utf-8")
    assert "Integrates the equations of motion of a scene" in python


@pytest.mark.slow
@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_examples_of_a_page_run(path, tmp_path, monkeypatch):
    """The examples of a page are one program, from the first to the last."""
    monkeypatch.chdir(tmp_path)
    short = {"integrator.t_end": 100.0, "tethers.elements": 2}
    if "run.h5" in path.read_text(encoding="utf-8"):
        esail.save(esail.simulate("baseline", short), "run.h5")
    if "many/ensemble.h5" in path.read_text(encoding="utf-8"):
        assert main(arguments("many", members=4, processes=1)) == 0
    blocks = re.findall(
        r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    exec(compile("\n".join(blocks), str(path), "exec"), {})

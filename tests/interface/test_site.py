"""The documentation site: it is built without a warning, its tables come from the package, and its examples
run."""

import importlib.util
import inspect
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

import esail_jax as esail
from esail_jax import control, observables
from esail_jax.cli import main
from esail_jax.design import objectives
from esail_jax.environment import gusts
from esail_jax.loads import tip_thrust
from esail_jax.scenes import deployment, plasma, tethers, voltage
from esail_jax.scenes.key_reference import describe_keys
from esail_jax.scenes.plausibility import doubts
from esail_jax.scenes.toml_text import to_toml
from support.compiled_nothing import forget_programs
from support.measured_sail import sail
from support.small_ensemble import arguments

ROOT = Path(__file__).parents[2]

PAGES = sorted(
    path
    for path in (ROOT / "docs").rglob("*.md")
    if "generated" not in path.parts and "```python" in path.read_text(encoding="utf-8")
)
"""Pages with examples in Python."""


@pytest.mark.nightly
def test_the_site_is_built_without_a_warning(tmp_path):
    """A warning is an error: a link to a page that does not exist, or a picture that is missing. Every key
    of a scene and every observable has its row. Notebooks are not run: `test_notebooks.py` does that."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", tmp_path / "trees"]
    command += ["-D", "nb_execution_mode=off"]
    done = subprocess.run([*command, ROOT / "docs", tmp_path / "site"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    keys = (tmp_path / "site" / "generated" / "keys.html").read_text(encoding="utf-8")
    assert all(f">{key.name}<" in keys for key in describe_keys())
    rows = (tmp_path / "site" / "generated" / "observables.html").read_text(encoding="utf-8")
    entries = (*observables.sail.OBSERVABLES, *observables.sail.ON_REQUEST, *observables.chain.OBSERVABLES)
    assert all(f">{entry.name}<" in rows for entry in entries)
    python = (tmp_path / "site" / "reference" / "python.html").read_text(encoding="utf-8")
    assert "Integrates the equations of motion of a scene" in python
    pages = [path.read_text(encoding="utf-8") for path in (tmp_path / "site").rglob("*.html")]
    assert sum("<math" in page for page in pages) > 5
    elsewhere = r"<(?:script|link|img|iframe|video|source)[^>]* (?:src|href)=[\"'](?:https?:)?//[^>]*>"
    assert [x for page in pages for x in re.findall(elsewhere, page)] == []


def test_a_formula_of_the_site_is_mathml_or_an_error():
    """The name of a function stands apart from its argument unless a bracket follows, as TeX has it. A
    command that is not known is an error, not a formula with a hole."""
    about = importlib.util.spec_from_file_location("mathml", ROOT / "docs" / "mathml.py")
    module = importlib.util.module_from_spec(about)
    about.loader.exec_module(module)
    apart = module.mathml(r"\frac{V_0}{2} \cos k\varphi", "block")
    assert "<mfrac>" in apart and 'rspace="0.167em">cos</mo><mi>k</mi>' in apart
    assert 'rspace="0">cos</mo>' in module.mathml(r"\cos(k\varphi)", "inline")
    with pytest.raises(ValueError, match="nosuchcommand"):
        module.mathml(r"\nosuchcommand x", "inline")


def test_the_guide_explains_every_objective():
    """The table of `docs/guide/design.md` has a row for every objective: its name, its unit, and the
    docstring of its function."""
    functions = objectives.OBJECTIVES | {name: f for name, (f, _) in objectives.RETAINED.items()}
    functions |= {name: f for name, (f, *_) in objectives.PARAMETRISED.items()}
    rows = []
    for name, function in functions.items():
        first, *others = (" ".join(x.split()) for x in inspect.getdoc(function).split("\n\n"))
        others = [] if name in objectives.PARAMETRISED else others  # the page explains its numbers
        meaning, unit = re.fullmatch(r"(.*) \[([^\[\]]+)\]\.", first).groups()
        cell = " ".join([meaning + ".", *others]).replace("|", r"\|")
        rows.append(f"| `{name}` | {unit} | {cell} |")
    page = (ROOT / "docs" / "guide" / "design.md").read_text(encoding="utf-8")
    table = page.partition("| objective |")[2].partition("\n\n")[0].splitlines()[2:]
    assert table == rows


def test_the_page_of_laws_has_every_law_with_its_keys():
    """A section of `docs/guide/laws.md` is that of one law: the sections of a chapter are the entries of
    its registry, no more and no fewer, and each names the keys that its law takes. Limits have sections of
    their own."""
    page = (ROOT / "docs" / "guide" / "laws.md").read_text(encoding="utf-8")
    chapters = {}
    for text in re.split(r"^## ", page, flags=re.MULTILINE)[1:]:
        about, *sections = re.split(r"^### ", text, flags=re.MULTILINE)
        title, _, lines = about.partition("\n")
        chapters[title] = {"": lines} | {x.partition("\n")[0].strip("`"): x for x in sections}
    limits = set(voltage.Voltage.__dataclass_fields__) & {"slew_rate", "power_limit", *voltage.LIMITS}
    names = {chapter: set(sections) - {"", "Phase"} for chapter, sections in chapters.items()}
    assert names["Thrust of the wind"] == set(plasma.THRUST_LAWS)
    assert names["Wind in time and place"] == {x for x in vars(gusts) if x.endswith("_wind")} - {
        "write_wind"
    }
    assert names["Voltage laws"] == set(voltage.LAWS)
    assert names["Limits of voltages"] == limits
    assert names["Deployment"] == set(deployment.LAWS)
    assert names["Sensors"] == {*control.__all__, "root_tension"}
    rows = set(re.findall(r"^\| `(\w+)` \|", chapters["Thrust at the tips"][""], re.MULTILINE))
    assert rows == set(get_args(tip_thrust.DirectionName))
    keys = {
        "Thrust of the wind": plasma.THRUST_LAWS,
        "Voltage laws": {law: set(names) - {*voltage.LIMITS} for law, names in voltage.LAWS.items()},
        "Deployment": deployment.LAWS,
        "Plasma brake": {"": list(plasma.PlasmaBrake.__dataclass_fields__)},
        "Thrust at the tips": {"": list(tethers.TipThrust.__dataclass_fields__)},
        "Temperature": {"": list(tethers.Thermal.__dataclass_fields__)},
    }
    missing = [
        (chapter, law, key)
        for chapter, laws in keys.items()
        for law, own in laws.items()
        for key in own
        if f"`{key}`" not in chapters[chapter][law]
    ]
    assert missing == []


def test_scene_files_of_the_pages_are_scenes(tmp_path):
    """A block of TOML with an end time is a whole scene file: it passes all checks, without a doubt of its
    numbers."""
    found = 0
    for path in (ROOT / "docs").rglob("*.md"):
        for text in re.findall(r"^```toml\n(.*?)^```", path.read_text(encoding="utf-8"), re.M | re.S):
            if "generated" not in path.parts and "[integrator]" in text:
                (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
                assert doubts(esail.load_scene(tmp_path / "scene.toml")) == ()
                found += 1
    assert found == 2


@pytest.mark.nightly
@pytest.mark.drops_programs
@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_examples_of_a_page_run(path, tmp_path, monkeypatch):
    """The examples of a page are one program, from the first to the last. They begin in a process without
    compiled programs, as a user does: in one that had those of two thousand tests, JAX 0.12.0.1 was aborted
    twice when it wrote a program of the page on design to its own cache."""
    forget_programs()
    monkeypatch.chdir(tmp_path)
    short = {"integrator.t_end": 100.0, "tethers.elements": 2}
    if "run.h5" in path.read_text(encoding="utf-8"):
        esail.save(esail.simulate("baseline", short), "run.h5")
    if "many/ensemble.h5" in path.read_text(encoding="utf-8"):
        assert main(arguments("many", members=4, processes=1)) == 0
    if "many-*/ensemble.h5" in path.read_text(encoding="utf-8"):
        for seed in (1, 2):
            assert main(arguments(f"many-{seed}", members=2, seed=seed, processes=1)) == 0
    if "telemetry.csv" in path.read_text(encoding="utf-8"):
        Path("sail.toml").write_text(to_toml(sail()), encoding="utf-8")
        esail.export(esail.simulate(sail(), save=("spin_rate",)), "telemetry.csv")
    blocks = re.findall(
        r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    exec(compile("\n".join(blocks), str(path), "exec"), {})

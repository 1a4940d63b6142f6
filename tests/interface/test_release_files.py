"""The files by which a release is found and installed agree with each other: version, title, licence and
libraries."""

import json
import re
import tomllib
from pathlib import Path

import esail_jax as esail

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
ZENODO = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
RECIPE = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")


def test_all_files_have_the_version_of_the_package():
    found = {
        PROJECT["version"],
        ZENODO["version"],
        re.search(r"^version: (\S+)$", CITATION, re.MULTILINE)[1],
        re.search(r'^  version: "(\S+)"$', RECIPE, re.MULTILINE)[1],
    }
    assert found == {esail.__version__}


def test_citation_and_archive_have_one_title_one_licence_and_the_same_keywords():
    assert f'title: "{ZENODO["title"]}"' in CITATION
    licences = {PROJECT["license"], ZENODO["license"], *re.findall(r"license: (\S+)", CITATION + RECIPE)}
    assert licences == {"Apache-2.0"}
    assert all(f"  - {word}\n" in CITATION for word in ZENODO["keywords"])


def test_the_conda_package_needs_the_libraries_of_the_project():
    run = RECIPE.partition("  run:\n")[2].partition("\n\n")[0]
    found = [line.removeprefix("    - ").replace(" ", "") for line in run.splitlines()]
    assert found == [f"python{PROJECT['requires-python']}", *PROJECT["dependencies"]]

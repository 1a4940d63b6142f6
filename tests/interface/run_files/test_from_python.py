"""`esail.export`, `esail.view` and `esail.animate` of a solution: the same as of its file."""

import html
import json
import re

import pytest
from PIL import Image

import esail_jax as esail
from esail_jax.errors import InputError


@pytest.fixture
def saved(solution, tmp_path):
    """The file of the solution."""
    path = tmp_path / "run.h5"
    esail.save(solution, path)
    return path


def data_of(page):
    """What a page says of its runs, without their titles."""
    found = re.search(r'id="data">(.*?)</script>', page.text, re.S)
    return [{k: x for k, x in run.items() if k != "title"} for run in json.loads(found[1])["runs"]]


@pytest.mark.parametrize(
    "how", [{}, {"observables": ["voltage[1]", "coning_angle"], "every": 5.0, "last": 40.0}]
)
def test_tables_and_arrays(solution, saved, tmp_path, how):
    tables = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for run, path in zip((solution, str(saved)), tables, strict=True):
        assert esail.export(run, path, **how) == path
    assert tables[0].read_bytes() == tables[1].read_bytes() != b""


def test_a_page_in_a_notebook_and_in_a_file(solution, saved, tmp_path):
    """The frame of a notebook holds the whole page, and its scripts may run."""
    path = tmp_path / "sail.html"
    page, of_file = esail.view(solution, path), esail.view(saved)
    assert path.read_text() == page.text
    assert data_of(page) == data_of(of_file)
    shown = page._repr_html_()
    assert html.unescape(re.search(r'srcdoc="(.*?)"', shown, re.S)[1]) == page.text
    assert 'sandbox="allow-scripts"' in shown and len(repr(page)) < 100


def test_several_runs_in_memory_have_numbers(solution):
    page = esail.view([solution, solution])
    assert "<title>run 1, run 2</title>" in page.text


def test_an_animation(solution, saved, tmp_path):
    """Of the size that is asked for, the same from memory and from the file but for the title."""
    look = {"seconds": 0.4, "fps": 10.0, "size": (120, 100), "exaggeration": 2.0, "axes": "spinning"}
    for run, name in ((solution, "a.gif"), (saved, "b.gif")):
        path = tmp_path / name
        assert esail.animate(run, path, **look) == path
        with Image.open(path) as image:
            assert image.size == (120, 100) and image.n_frames == 4


def test_what_exists_is_kept(solution, tmp_path):
    for write, name in ((esail.export, "a.csv"), (esail.view, "a.html"), (esail.animate, "a.gif")):
        path = tmp_path / name
        path.write_text("mine")
        with pytest.raises(FileExistsError, match="overwrite=True"):
            write(solution, path)
        assert path.read_text() == "mine"


REFUSED = [
    (esail.export, "a.xls", {}, "`path` must end in .csv, .nc, .zarr, .oem or .aem"),
    (
        esail.export,
        "a.csv",
        {"observables": "conning_angle"},
        "`observables` must be observables of the run",
    ),
    (esail.export, "a.csv", {"every": 0.0}, "`every` must be positive, but is 0"),
    (esail.export, "a.csv", {"first": float("nan")}, "`first` must be a number of seconds, or a date"),
    (esail.export, "a.csv", {"first": "soon"}, "`first` must be a number of seconds"),
    (esail.export, "a.csv", {"mission": "X"}, "`mission` must be left out with .csv"),
    (esail.export, "a.oem", {"time_system": "GPS"}, "`time_system` must be UTC or TDB"),
    (esail.export, "a.oem", {}, "`run` must have an epoch"),
    (esail.view, "a.pdf", {}, "`path` must end in .html or .htm"),
    (esail.view, "a.html", {"axes": "moving"}, "`axes` must be inertial or spinning"),
    (esail.view, "a.html", {"colour": "red"}, "`colour` must be one of"),
    (esail.view, "a.html", {"member": 0}, "`member` must be left out"),
    (esail.animate, "a.gif", {"fps": -1.0}, "`fps` must be positive and finite"),
    (esail.animate, "a.gif", {"size": (1, 2, 3)}, "`size` must be width and height in pixels"),
    (esail.animate, "a.gif", {"exaggeration": float("nan")}, "`exaggeration` must be positive"),
]


@pytest.mark.parametrize(
    ("write", "name", "how", "line"), REFUSED, ids=[f"{f.__name__} {line}" for f, *_, line in REFUSED]
)
def test_wrong_arguments_are_named_and_nothing_is_written(solution, tmp_path, write, name, how, line):
    with pytest.raises(InputError) as error:
        write(solution, tmp_path / name, **how)
    assert str(error.value).startswith(line) and not list(tmp_path.iterdir())


@pytest.mark.parametrize("write", [esail.export, esail.view, esail.animate])
def test_what_is_no_run_is_refused(write, tmp_path):
    path = tmp_path / {esail.export: "a.csv", esail.view: "a.html", esail.animate: "a.gif"}[write]
    with pytest.raises(InputError, match="`run` must be a solution, an ensemble or the path of a file"):
        write({"time": 1}, path)


def test_the_names_of_the_package_are_those_for_users():
    """`dir(esail)` has functions, tables and packages, and nothing that the package itself imports."""
    names = dir(esail)
    assert {"simulate", "plot", "view", "animate", "export", "ensembles", "design"} <= set(names)
    assert not {"os", "sys", "Any", "HOME", "MODULES", "importlib", "TYPE_CHECKING"} & set(names)
    assert all(hasattr(esail, name) for name in names)

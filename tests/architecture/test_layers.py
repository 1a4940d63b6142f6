"""A module imports only from its own layer or a lower one, and heavy libraries only in some packages.

The table is the architecture. Physics at a point is lowest; above it are the sum of the terms, the
iteration matrix, the steppers, and all modules that know about scenes, files and figures.
"""

import ast
import graphlib
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "esail_jax"

LAYERS = (
    ("constants", "array_types", "atomic_file", "compilation", "cores", "errors", "html", "interrupts"),
    ("numerics", "environment", "calendar", "messages", "wind_files"),
    ("coordinates", "measurements", "physics", "point_fields", "terms"),
    ("control", "elements", "loads", "joints"),
    ("assembly", "sensors", "commanded_assembly", "system"),
    ("iteration_matrix", "rod_chain"),
    ("steppers", "equilibria"),
    ("observables", "scenes"),
    ("simulation", "modal"),
    ("files", "ensembles", "design", "identification", "plotting", "viewing"),
    ("__init__", "commands"),
    ("cli", "__main__"),
)
"""The layers, lowest first. A name is that of a module, or of a folder with all its modules."""

ONLY_IN = {
    "matplotlib": {"plotting", "viewing"},
    "PIL": {"viewing"},
    "imageio_ffmpeg": {"viewing"},
    "mpl_toolkits": {"plotting"},
    "jplephem": {"calendar"},
    "h5py": {"files", "ensembles", "design", "commands"},
}
"""The folders that may import a library that is slow to import or belongs to a file format."""

LAYER = {room: number for number, rooms in enumerate(LAYERS) for room in rooms}

FILES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts): path
    for path in sorted(PACKAGE.rglob("*.py"))
}
"""The path of every module, by its dotted name in the package; that of a folder is `folder.__init__`."""


def room_of(module: str) -> str:
    """The first part of a dotted name inside the package."""
    return module.partition(".")[0]


def imported(path: Path) -> set[str]:
    """The absolute dotted names that a file imports, also inside functions.

    `from a import b` gives a.b, whether b is a module or not.
    """
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are absolute here"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def modules_used(path: Path) -> set[str]:
    """The modules of the package that a file imports."""
    found = set()
    for name in imported(path):
        if room_of(name) != "esail_jax":
            continue
        inside = name.partition(".")[2]
        owner = inside.rpartition(".")[0]
        candidates = (inside, f"{inside}.__init__", owner, f"{owner}.__init__", "__init__")
        found.add(next(c for c in candidates if c.lstrip(".") in FILES).lstrip("."))
    return found


def test_every_module_has_a_layer():
    assert {room_of(module) for module in FILES} == set(LAYER)


@pytest.mark.parametrize("module", FILES)
def test_imports_come_from_own_or_lower_layer(module):
    above = {used for used in modules_used(FILES[module]) if LAYER[room_of(used)] > LAYER[room_of(module)]}
    assert not above, f"{module} imports from above: {sorted(above)}"


def test_no_circle_of_imports():
    # Modules of one layer may use each other, in one direction.
    order = graphlib.TopologicalSorter({module: modules_used(path) for module, path in FILES.items()})
    order.prepare()  # raises CycleError, which names the circle


@pytest.mark.parametrize("library", ONLY_IN)
def test_library_stays_in_its_room(library):
    users = {room_of(m) for m, path in FILES.items() if library in {room_of(n) for n in imported(path)}}
    assert users <= ONLY_IN[library]
    assert users, f"nobody imports {library}: the rule has lost its subject"


def test_only_the_command_line_and_the_function_plot_draw():
    users = {m for m, path in FILES.items() if "plotting" in map(room_of, modules_used(path))}
    commands = {"commands.plot", "commands.modes", "commands.design", "commands.fitting", "commands.info"}
    assert {m for m in users if room_of(m) != "plotting"} == {*commands, "__init__"}


def test_a_wrong_import_is_seen(tmp_path):
    # The text has every form of import, one of them inside a function.
    text = """
import esail_jax.cores
from esail_jax import terms
from esail_jax.scenes import rules
from esail_jax import simulate, Scene
def later():
    from esail_jax.steppers.consistent import project
"""
    file = tmp_path / "wrong.py"
    file.write_text(text)
    assert modules_used(file) == {
        "cores", "terms", "scenes.rules", "__init__", "steppers.consistent",
    }  # fmt: skip

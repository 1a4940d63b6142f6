"""Runs of the study of [PGV] that are kept in a file, so that a figure can be drawn again without running.

A run's file is `experiments/pgv_common/runs/NAME-KEY.h5`. KEY is a checksum of the scene and of the source
of the package: after a change of either, the run is computed again. The files are not in the repository.
"""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import esail_jax as esail
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.toml_text import to_toml

FOLDER = Path(__file__).parent / "runs"

PAPERS_METHOD = {"integrator.method": "generalized-alpha"}
"""The method of [PGV], with the package's step (0.1 s) and spectral radius (0.25)."""

ELEMENTS = (1, 2, 3, 4, 5, 6, 7, 8, 9)
"""Numbers of elements per tether in the study of convergence."""

MODELS = {
    "cable": {},
    "cable, no bending": {
        "tethers.bending": False,
        "tethers.second_moment": None,
        "tethers.bending_damping_time": None,
    },
    "truss": {
        "tethers.element": "truss",
        "tethers.bending": False,
        "tethers.second_moment": None,
        "tethers.bending_damping_time": None,
    },
}
"""Overrides that make the three models of a tether from the baseline."""

CASES = {"alpha-0": "sun-facing", "alpha-10": "baseline", "voltage-off": "voltage-off"}
"""Names of the cases of [PGV] Sec. 4.3 and their built-in scenes."""


def source_checksum() -> str:
    """A checksum of the source of the package."""
    root, checksum = Path(esail.__file__).parent, hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        checksum.update(path.read_bytes())
    return checksum.hexdigest()


def kept_run(
    name: str,
    scene: str,
    overrides: Mapping[str, Any] | None = None,
    save: Sequence[str] | None = None,
    shown: str | None = None,
) -> esail.Solution:
    """The solution of a scene, from its file if there is one.

    save: names of the observables to save, all of them if None; shown: name that is printed, if it is not
    that of the file. The statistics of a solution from a file
    are those of the run that made the file.
    """
    loaded = with_method(esail.load_scene(scene, overrides))
    text = "\n".join([to_toml(loaded), str(save), source_checksum()])
    path = FOLDER / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:10]}.h5"
    if path.exists():
        return esail.load(path)
    print(f"running {shown or name} ...", flush=True)
    solution = esail.simulate(loaded, save=save)
    stats = solution.stats
    print(f"  {stats['wall_time']:.1f} s, compiled in {stats['compile_time']:.1f} s", flush=True)
    FOLDER.mkdir(exist_ok=True)
    esail.save(solution, path)
    return solution


def model_run(model: str, elements: int, shown: str | None = None) -> esail.Solution:
    """Three spin periods of the baseline at 10 deg, with one of MODELS and this many elements per
    tether, by the paper's method. shown: as for `kept_run`."""
    overrides = PAPERS_METHOD | MODELS[model] | {"tethers.elements": elements}
    name = f"{model.replace(', ', '-').replace(' ', '-')}-{elements}"
    return kept_run(name, "baseline", overrides, shown=shown)


def case_run(case: str) -> esail.Solution:
    """Three spin periods of one of CASES by the paper's method."""
    if case == "alpha-10":  # the study of convergence has this run, too, under the name of its model
        return model_run("cable", 5, shown=case)
    return kept_run(case, CASES[case], PAPERS_METHOD)

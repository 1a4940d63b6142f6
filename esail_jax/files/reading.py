"""Reading saved rows of a run, or of one member of an ensemble, without JAX."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from esail_jax.files.opening import ArgumentError, RunFileError, intact, open_run
from esail_jax.scenes.loading import parse
from esail_jax.scenes.own_terms import OWN_TERMS, AbsentTerms
from esail_jax.scenes.scene import Scene


@dataclasses.dataclass(frozen=True)
class SavedRun:
    """The saved rows of a run.

    path, member: what is read, with None for the member of a file of one run; time: [s], (time); rows:
    observables by name, time first; attributes: `unit`, `symbol` and `axes` after time, by observable. Rows
    after a failure are left out."""

    path: Path
    member: int | None
    scene: Scene
    time: np.ndarray
    rows: Mapping[str, np.ndarray]
    attributes: Mapping[str, Mapping[str, Any]]

    @property
    def name(self) -> str:
        """What is read, for titles: the name of the file, with that of its folder for an ensemble."""
        if self.member is None:
            return self.path.name
        return f"{self.path.parent.name}/{self.path.name}, member {self.member}".lstrip("/")

    def need(self, *names: str) -> None:
        """Raises RunFileError unless the file holds these observables."""
        for name in names:
            if name not in self.rows:
                raise RunFileError(f"`{self.path}` must hold the observable {name}, but lacks it")


def read_runs(path: Path, members: tuple[int, ...]) -> list[SavedRun]:
    """The run in a file, or the members of an ensemble with these numbers.

    Raises RunFileError for a file that cannot be read or has no rows, and for members that it lacks."""
    with open_run(path) as file, intact(path):
        if "members" not in file:
            if members:
                raise ArgumentError("members", "be left out with a file of one run", f"is {members[0]}")
            return [read_rows(file, path, None)]
        count = int(file.attrs["members"])
        if not members:
            raise ArgumentError("members", f"be given with an ensemble (0 to {count - 1})", "is not")
        for member in members:
            if not 0 <= member < count:
                raise ArgumentError("members", f"be between 0 and {count - 1}", f"is {member}")
        return [read_rows(file, path, member) for member in members]


def read_rows(file: h5py.File, path: Path, member: int | None) -> SavedRun:
    """A run, or a member of an ensemble. Raises RunFileError if it has no rows."""
    place = () if member is None else member
    rows = {key: data[place] for key, data in file["observables"].items()}
    attributes = {
        key: {
            "unit": data.attrs["unit"],
            "symbol": data.attrs["symbol"],
            "axes": tuple(data.attrs["axes"])[1 if member is None else 2 :],
        }
        for key, data in file["observables"].items()
    }
    time = file["time"][()]
    known = known_rows(rows, len(time))
    if not known:
        of = "" if member is None else f" of member {member}"
        raise RunFileError(f"`{path}` must hold saved instants{of}, but has none")
    scene = scene_in(file, path)
    return SavedRun(path, member, scene, time[:known], {k: x[:known] for k, x in rows.items()}, attributes)


def scene_in(file: h5py.File, path: Path) -> Scene:
    """The scene of a file. Terms that a user wrote are not in it: the scene knows their names, and
    is no scene to run without them."""
    names = tuple(file.attrs.get("own_terms", ()))
    absent = {OWN_TERMS: AbsentTerms(names)} if names else None
    return parse(file["scene"].asstr()[()], str(path), absent)


def known_rows(rows: Mapping[str, np.ndarray], count: int) -> int:
    """The number of leading instants at which the kinetic energy, or else any observable, is
    finite."""
    signals = [rows["kinetic_energy"]] if "kinetic_energy" in rows else list(rows.values())
    known = np.zeros(count, bool)
    for signal in signals:
        known |= np.isfinite(signal).reshape(count, -1).any(1)
    return count if known.all() else int(np.argmin(known))

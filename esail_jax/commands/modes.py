"""`esail modes`: the table of a sail's modes, as text, as a JSON file and as figures."""

import json
from pathlib import Path

from esail_jax.atomic_file import atomic_file
from esail_jax.modal.sail_modes import modes
from esail_jax.scenes.scene import Scene


def print_modes(
    scene: Scene, file: Path | None, folder: Path | None, count: int | None, floquet: bool = False
) -> None:
    """Prints the modes of a scene, writes all of them to `file` and the figures to `folder`.
    floquet: with the multipliers of the periodic orbit.

    Raises SceneError, SimulationError, OSError."""
    table = modes(scene, count=count, floquet=floquet)
    print(table)
    if file is not None:
        lines = ",\n".join(json.dumps(record) for record in table.records())
        with atomic_file(file) as new:
            new.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
        print(file)
    if folder is not None:
        from esail_jax.plotting.modes import plot_modes

        for path in plot_modes(table, folder):
            print(path)

"""The size of a run file that is written in many parts."""

import h5py
import numpy as np

from esail_jax.files.hdf5 import append, atomic_hdf5, create_quantity

NAMES, PARTS, ROWS, NUMBERS = "abcdefgh", 60, 20, 36


def test_a_file_that_is_written_in_many_parts_has_no_holes(tmp_path):
    """Every part extends the last chunk of every dataset, which then needs more room elsewhere. Its old
    room is used again: a file that lost it would be 1.38 times as large as its data. The bound is 1.15,
    because the rooms that the last part has left are free (1.09 is measured)."""
    path, random = tmp_path / "run.h5", np.random.default_rng(0)
    with atomic_hdf5(path) as file:
        for name in NAMES:
            create_quantity(file, name, (0, NUMBERS), ("time", "number"), "m", name, grows=True)
    for _ in range(PARTS):
        with atomic_hdf5(path, update=True) as file:
            for name in NAMES:
                append(file[name], random.random((ROWS, NUMBERS)))
    with h5py.File(path) as file:
        assert file["a"].shape == (PARTS * ROWS, NUMBERS)
        stored = sum(file[name].id.get_storage_size() for name in NAMES)
    assert path.stat().st_size < 1.15 * stored

"""The observables of a run file as a table of comma-separated values, or in a netCDF file.

    with atomic_file("run.csv") as part:
        write_csv("run.h5", part)

A table has one line for each saved instant and one column for each number of it. This module needs JAX for
netCDF only.
"""

import csv
import importlib.util
import itertools
import os
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from esail_jax.calendar.instants import dated
from esail_jax.files.opening import ArgumentError, RunFileError, intact, open_single


def write_csv(run: str | os.PathLike, path: Path, calendar: bool = False) -> None:
    """Writes the observables of a run file as comma-separated values.

    The first line names the columns: `time [s]`, `kinetic_energy [J]`, `coning_angle[1] [rad]` (tether 1).
    Places along an axis are counted from 1, as tethers are in messages. Numbers have all their digits.
    calendar: whether a column `date [UTC]`, or `date [TDB]`, follows that of the times, for runs with an
    epoch. Raises RunFileError."""
    with open_single(run) as file, intact(run), open(path, "w", encoding="utf-8", newline="") as table:
        headers, values = zip(*columns(file, run, calendar), strict=True)
        writer = csv.writer(table)
        writer.writerow(headers)
        writer.writerows(zip(*(column.tolist() for column in values), strict=True))


def columns(file: h5py.File, run: str | os.PathLike, calendar: bool) -> Iterator[tuple[str, np.ndarray]]:
    """Yields header and values of every column of an open run file."""
    yield "time [s]", file["time"][()]
    if calendar:
        epoch = epoch_of(file, run)
        yield f"date [{epoch[-3:]}]", np.array(dated(epoch, file["time"][()]))
    for name, data in file["observables"].items():
        values, unit = data[()], data.attrs["unit"]
        for place in itertools.product(*map(range, values.shape[1:])):
            where = f"[{','.join(str(index + 1) for index in place)}]" if place else ""
            yield f"{name}{where} [{unit}]", values[(..., *place)]


def epoch_of(file: h5py.File, run: str | os.PathLike) -> str:
    """The epoch of an open run file, with its time scale. Raises RunFileError for a run without one."""
    if "epoch" not in file.attrs:
        raise RunFileError(f"`{run}` must have an epoch (`initial.epoch`) for dates, but has none")
    return str(file.attrs["epoch"])


def check_netcdf() -> None:
    """Raises ArgumentError if the library that writes netCDF files is missing."""
    if importlib.util.find_spec("xarray") is None:
        got = "ends in .nc: `pip install 'esail_jax[xarray]'` installs it"
        raise ArgumentError("path", "end in .csv unless xarray is installed", got)


def write_netcdf(run: str | os.PathLike, path: Path) -> None:
    """Writes the observables of a run file with units, symbols and named axes as netCDF (version 3, which
    every reader of netCDF knows). Raises RunFileError."""
    from esail_jax.files.run_file import load

    load(run).to_xarray().to_netcdf(path, engine="scipy")

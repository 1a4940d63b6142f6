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
from esail_jax.files.selection import ALL, Selection, chosen_columns, chosen_rows


def write_csv(
    run: str | os.PathLike, path: Path, calendar: bool = False, selection: Selection = ALL
) -> None:
    """Writes observables of a run file as comma-separated values.

    The first line names the columns: `time [s]`, `kinetic_energy [J]`, `coning_angle[1] [rad]` (tether 1).
    Places along an axis are counted from 1, as tethers are in messages. Numbers have all their digits.
    calendar: whether a column `date [UTC]`, or `date [TDB]`, follows that of the times, for runs with an
    epoch; selection: which observables and instants. Raises RunFileError."""
    with open_single(run) as file, intact(run), open(path, "w", encoding="utf-8", newline="") as table:
        headers, values = zip(*columns(file, run, calendar, selection), strict=True)
        writer = csv.writer(table)
        writer.writerow(headers)
        writer.writerows(zip(*(column.tolist() for column in values), strict=True))


def columns(
    file: h5py.File, run: str | os.PathLike, calendar: bool, selection: Selection
) -> Iterator[tuple[str, np.ndarray]]:
    """Yields header and values of every column of an open run file. Raises RunFileError."""
    rows = chosen_rows(file, selection)
    time = file["time"][()][rows]
    yield "time [s]", time
    if calendar:
        epoch = epoch_of(file, run)
        yield f"date [{epoch[-3:]}]", np.array(dated(epoch, time))
    for name, places in itertools.groupby(chosen_columns(file, selection), lambda column: column.name):
        data = file["observables"][name]
        values, unit = data[()][rows], data.attrs["unit"]
        for place in (column.place for column in places):
            where = f"[{','.join(map(str, place))}]" if place else ""
            yield f"{name}{where} [{unit}]", values[(..., *(index - 1 for index in place or ()))]


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


def write_netcdf(run: str | os.PathLike, path: Path, selection: Selection = ALL) -> None:
    """Writes observables of a run file with units, symbols and named axes as netCDF (version 3, which every
    reader of netCDF knows). selection: which observables, as whole arrays, and which instants. Raises
    RunFileError."""
    from esail_jax.files.run_file import load

    with open_single(run) as file, intact(run):
        rows, chosen = chosen_rows(file, selection), chosen_columns(file, selection)
    names = list(dict.fromkeys(column.name for column in chosen))
    if selection.observables is not None and any(x.place is not None for x in selection.observables):
        raise ArgumentError("--observables", "be whole arrays for .nc", "has a place of one")
    load(run).to_xarray()[names].isel(time=rows).to_netcdf(path, engine="scipy")

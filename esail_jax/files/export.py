"""A run or an ensemble for other programs: `export` writes a table of comma-separated values, a netCDF
file, a Zarr store, or the orbit or the attitude of a run as a message of the CCSDS.

A table has one line for each saved instant and one column for each number of it; that of an ensemble has
these lines for each member, one after the other, with the number of the member and its inputs. JAX is
needed for netCDF and Zarr only.
"""

import csv
import importlib.util
import itertools
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from esail_jax.atomic_file import atomic_file, atomic_folder
from esail_jax.calendar.instants import dated
from esail_jax.files import messages
from esail_jax.files.opening import ArgumentError, RunFileError, holds_ensemble
from esail_jax.files.reading import Members, Results, file_of, open_results
from esail_jax.files.selection import Column, Selection, chosen_columns, chosen_rows, columns_of
from esail_jax.scenes.key_reference import unit_of

TABLE, NETCDF, ZARR, ORBIT, ATTITUDE = ".csv", ".nc", ".zarr", ".oem", ".aem"

PART = ("observables", "first", "last", "every")
HEAD = ("object_name", "mission", "time_system")

FORMATS = {TABLE: ("calendar", *PART), NETCDF: PART, ZARR: PART, ORBIT: HEAD, ATTITUDE: HEAD}
"""Endings of the files that are written, and the arguments that each one has."""

ARGUMENTS = ("calendar", *PART, *HEAD)
"""Arguments of `export` that belong to a format."""

LIBRARIES = {NETCDF: ("xarray",), ZARR: ("xarray", "zarr")}
"""Libraries that write a format, which the extra of the last one installs."""

STORE = "zarr.json"
"""A file by which a folder is known as a Zarr store."""


def export(
    run: Any,
    path: str | os.PathLike,
    *,
    observables: str | Sequence[str] | None = None,
    first: float | str | np.datetime64 | None = None,
    last: float | str | np.datetime64 | None = None,
    every: float | None = None,
    calendar: bool = False,
    object_name: str | None = None,
    mission: str | None = None,
    time_system: str | None = None,
    overwrite: bool = False,
) -> Path:
    """Writes a run or an ensemble for other programs, as `esail export` does, and returns the path.

    run: a solution, an ensemble, or the path of a run file or of an ensemble; path: the file to write,
    whose ending is the format:

    - .csv: a table. The first line names the columns: `time [s]`, `kinetic_energy [J]`,
      `coning_angle[1] [rad]` (tether 1). Numbers have all their digits. The table of an ensemble is long:
      its first columns are `member` and `time [s]`, then come the inputs of the member;
    - .nc (netCDF) and .zarr: arrays with units, symbols and named axes, as `to_xarray` gives them;
    - .oem and .aem: the orbit of the hub about the Sun, or its attitude, as messages of the CCSDS in
      EME2000, of a run with an epoch.

    observables: names of what is written, such as "coning_angle" or "voltage[1],coning_angle" (places count
    from 1), None for all; first, last: the ends of the time that is written, in seconds or, of a run with
    an epoch, as dates (texts or datetime64); every: least time between two rows [s]; calendar: whether a
    table has a column with the date of every instant; object_name, mission: name and international
    designator of the spacecraft in a message; time_system: time scale of the dates of a message, "UTC"
    (None) or "TDB"; overwrite: whether a file that exists is replaced.

        esail.export(run, "run.csv", observables="coning_angle[1],voltage", every=60.0)

    Raises FileExistsError for a path that exists, ArgumentError for an argument that does not suit the
    format or the run, and RunFileError for a file that cannot be read, or lacks what is needed."""
    path = Path(path)
    given = {"observables": observables, "first": first, "last": last, "every": every, "calendar": calendar}
    given |= {"object_name": object_name, "mission": mission, "time_system": time_system}
    check_format(path, given)
    if path.exists() and not overwrite:
        raise FileExistsError(f"`{path}` must not exist (or pass overwrite=True), but does")
    write(run, path, given)
    return path


def check_format(path: Path, given: dict[str, Any]) -> None:
    """Raises ArgumentError for a path of another format, for an argument that its format has not, and if a
    library is missing."""
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        *most, last = FORMATS
        raise ArgumentError("path", f"end in {', '.join(most)} or {last}", f"ends in {suffix!r}")
    for name, value in given.items():
        if value is not None and value is not False and name not in FORMATS[suffix]:
            raise ArgumentError(name, f"be left out with {suffix}", "is given")
    if given["time_system"] not in (None, "UTC", "TDB"):
        raise ArgumentError("time_system", "be UTC or TDB", f"is {given['time_system']!r}")
    for library in LIBRARIES.get(suffix, ()):
        if importlib.util.find_spec(library) is None:
            extra = LIBRARIES[suffix][-1]
            got = f"ends in {suffix}: `pip install 'esail_jax[{extra}]'` installs it"
            raise ArgumentError("path", f"end in .csv unless {library} is installed", got)


def write(run: Any, path: Path, given: dict[str, Any]) -> str:
    """Writes a run or an ensemble. given: the arguments of `export`, which `check_format` has checked.
    Returns what is to be said of the result: of a message, how far it may be off between its rows."""
    suffix = path.suffix.lower()
    names = given["observables"]
    part = (given["first"], given["last"], given["every"])
    selection = Selection(None if names is None else columns_of(names), *part)
    if suffix == ZARR:
        if path.exists() and not (path / STORE).exists():
            raise ArgumentError("path", "be a Zarr store to be replaced", f"{path} is none")
        data = dataset(run, suffix, selection)
        with atomic_folder(path) as folder:
            data.to_zarr(folder, mode="w", consolidated=False)
        return ""
    with atomic_file(path) as file:
        if suffix == TABLE:
            return write_csv(run, file, given["calendar"], selection)
        if suffix == NETCDF:
            # version 3, which every reader of netCDF knows
            dataset(run, suffix, selection).to_netcdf(file, engine="scipy")
            return ""
        named = messages.Named(given["object_name"], given["mission"], given["time_system"] or "UTC")
        return (messages.write_oem if suffix == ORBIT else messages.write_aem)(run, file, named)


# ---- tables -------------------------------------------------------------------------------------


def write_csv(run: Any, path: Path, calendar: bool, selection: Selection) -> str:
    """Writes a table. Returns a sentence on the members that an ensemble lacks, if it does."""
    with open_results(run) as results, open(path, "w", encoding="utf-8", newline="") as table:
        rows = chosen_rows(results, selection)
        leading = {"time [s]": results.time[rows]}
        if calendar:
            epoch = results.epoch
            leading[f"date [{epoch[-3:]}]"] = np.array(dated(epoch, results.time[rows]))
        writer, chosen = csv.writer(table), chosen_columns(results, selection)
        if results.members is None:
            write_block(writer, leading | dict(columns(results, None, rows, chosen)), True)
            return ""
        computed = np.flatnonzero(results.members.computed).tolist()
        if len(computed) == 0:
            raise RunFileError(f"`{results.path}` must have members that are computed, but has none")
        for member in computed:
            before = {"member": np.full(len(rows), member)} | leading
            inputs = {name: np.full(len(rows), x) for name, x in inputs_of(results.members, member)}
            block = before | inputs | dict(columns(results, member, rows, chosen))
            write_block(writer, block, member == computed[0])
        missing = results.members.count - len(computed)
        return f"{missing} of {results.members.count} members are not computed yet." if missing else ""


def write_block(writer: Any, block: dict[str, np.ndarray], with_header: bool) -> None:
    """Writes columns, and before them their names."""
    if with_header:
        writer.writerow(block)
    writer.writerows(zip(*(column.tolist() for column in block.values()), strict=True))


def columns(
    results: Results, member: int | None, rows: np.ndarray, chosen: Sequence[Column]
) -> Iterator[tuple[str, np.ndarray]]:
    """Yields header and values of the columns of a run, or of a member of an ensemble."""
    for name, places in itertools.groupby(chosen, lambda column: column.name):
        values = results.observables[name][() if member is None else member][rows]
        for place in (column.place for column in places):
            header = f"{name}{bracketed(place or ())} [{results.about[name].unit}]"
            yield header, values[(..., *(index - 1 for index in place or ()))]


def inputs_of(members: Members, member: int) -> Iterator[tuple[str, float]]:
    """Yields header and value of the inputs of a member."""
    for key, values in members.inputs.items():
        for place in np.ndindex(values.shape[1:]):
            unit = unit_of(key)
            header = f"{key}{bracketed(tuple(i + 1 for i in place))}" + (f" [{unit}]" if unit else "")
            yield header, values[(member, *place)]


def bracketed(place: tuple[int, ...]) -> str:
    """A place of an array, from 1, in brackets; nothing for that of a number."""
    return f"[{','.join(map(str, place))}]" if place else ""


# ---- arrays -------------------------------------------------------------------------------------


def dataset(run: Any, suffix: str, selection: Selection) -> Any:
    """The selected observables and instants as a dataset of xarray. Raises ArgumentError for places of an
    array."""
    with open_results(run) as results:
        rows, chosen = chosen_rows(results, selection), chosen_columns(results, selection)
    names = list(dict.fromkeys(column.name for column in chosen))
    if selection.observables is not None and any(x.place is not None for x in selection.observables):
        raise ArgumentError("observables", f"be whole arrays for {suffix}", "has a place of one")
    if isinstance(run, str | os.PathLike):
        from esail_jax.ensembles.ensemble_file import load_ensemble
        from esail_jax.files.run_file import load

        path = file_of(run)
        run = load_ensemble(path, names) if holds_ensemble(path) else load(path)
    data = run.to_xarray()
    others = [name for name, x in data.data_vars.items() if "time" not in x.dims and "." not in name]
    inputs = list(getattr(run, "inputs", ()))
    found = data[list(dict.fromkeys([*others, *inputs, *names]))]
    return found if getattr(run, "reduced", None) else found.isel(time=rows)

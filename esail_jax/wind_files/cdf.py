"""CDF files of the OMNI data set, as CDAWeb gives them, read with cdflib.

| file | flow speed [km/s] | proton density [1/cm^3] | between rows |
|---|---|---|---|
| `omni2_h0_mrg1hr_*.cdf` | `V` | `N` | an hour |
| `omni_hro_1min_*.cdf`, `omni_hro2_*` | `flow_speed` | `proton_density` | one minute or five |

`Epoch` is the start of what a row is the average of, as in the text files (`omni.py`): rows are placed at
the middle. Numbers equal to the attribute FILLVAL of their variable, or to all nines of the text files, are
absent."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from esail_jax.calendar.instants import FIRST_DAYS, Instants
from esail_jax.errors import SceneError
from esail_jax.wind_files.rows import FILLS, SI, WIND_FILE, Rows, check_increasing

MAGIC = (b"\xcd\xf3\x00\x01", b"\xcd\xf2\x60\x02", b"\x00\x00\xff\xff")
"""First bytes of CDF files of the versions 3, 2.6 and earlier."""

VARIABLES = (("V", "N"), ("flow_speed", "proton_density"))
"""Names of speed and density."""

TIME = "Epoch"
"""Name of the instants."""

CADENCES = (60.0, 300.0, 3600.0)
"""Times [s] between rows."""

NOT_INSTALLED = "be read with cdflib (`pip install 'esail_jax[cdf]'`)"


def is_cdf(head: bytes) -> bool:
    """Tells whether a file that begins with these bytes is a CDF file."""
    return head[:4] in MAGIC


def read_cdf(path: Path, source: str) -> Rows:
    """The rows of a CDF file. source: what the file is called in a message. Raises SceneError for a file
    that is damaged, or has other variables, and if cdflib is missing."""
    try:
        import cdflib
    except ImportError:
        raise SceneError(
            WIND_FILE, NOT_INSTALLED, f"{source} is a CDF file and cdflib is missing"
        ) from None
    try:
        with cdflib.CDF(path) as file:
            return rows_of(file, cdflib.cdfepoch, source)
    except SceneError:
        raise
    except Exception as error:  # of any kind, by what is damaged
        raise SceneError(WIND_FILE, "be an intact CDF file", f"{source} cannot be read: {error}") from error


def rows_of(file: Any, epochs: Any, source: str) -> Rows:
    """The rows of an open file. epochs: what turns its instants into dates."""
    names = file.cdf_info().zVariables + file.cdf_info().rVariables
    pair = next((pair for pair in VARIABLES if {*pair, TIME} <= set(names)), None)
    if pair is None:
        wanted = " or ".join(f"{TIME}, {speed} and {density}" for speed, density in VARIABLES)
        got = f"{source} has {', '.join(names[:12]) or 'none'}"
        raise SceneError(WIND_FILE, f"have the variables {wanted} (OMNI)", got)
    day, second = instants_of(file.varget(TIME), epochs)
    count = len(day)
    if count == 0:
        raise SceneError(WIND_FILE, "have rows", f"{source} has none")
    missing = dict[int, str]()
    columns = {}
    for key, name in zip(FILLS, pair, strict=True):
        column = np.array(file.varget(name), float)
        if column.shape != (count,):
            got = f"{name} of {source} has the shape {column.shape}"
            raise SceneError(WIND_FILE, f"have {count} numbers in every variable", got)
        absent = is_absent(column, key, file.varattsget(name).get("FILLVAL"))
        for row in np.flatnonzero(~absent & (column <= 0.0 if key == "speed" else column < 0.0))[:1]:
            must = "have positive speeds" if key == "speed" else "have densities that are not negative"
            raise SceneError(WIND_FILE, must, f"record {row} of {source} has {column[row]:g}")
        missing |= dict.fromkeys(np.flatnonzero(absent).tolist(), f"{name} is a fill value")
        columns[key] = np.where(absent, np.nan, SI[key] * column)
    cadence = cadence_of(day, second, source)
    time = Instants(day, second + 0.5 * cadence, "UTC")
    form = f"OMNI file (CDF) with rows every {cadence:g} s"
    line = np.arange(count)
    return check_increasing(
        Rows(
            source,
            form,
            time,
            columns["speed"],
            columns["number_density"],
            line,
            cadence,
            missing,
            "record",
        )
    )


def instants_of(epoch: Any, epochs: Any) -> tuple[Int[np.ndarray, " row"], Float[np.ndarray, " row"]]:
    """The days (Modified Julian Date) and seconds of the day of instants of any type that CDF has."""
    parts = np.atleast_2d(epochs.breakdown(np.atleast_1d(epoch))).astype(float)
    parts = np.pad(parts, ((0, 0), (0, max(0, 9 - parts.shape[1]))))
    year, month, day, hour, minute, second, milli, micro, nano = parts[:, :9].T
    months = (12 * (year - 1970) + month - 1).astype(int).astype("datetime64[M]")
    days = months.astype("datetime64[D]") + (day - 1).astype(int)
    fraction = 1e-3 * milli + 1e-6 * micro + 1e-9 * nano
    return (days - FIRST_DAYS).astype(int), 3600.0 * hour + 60.0 * minute + second + fraction


def is_absent(column: Float[np.ndarray, " row"], key: str, fill: Any) -> Bool[np.ndarray, " row"]:
    """Tells which numbers are none. fill: the attribute FILLVAL, None if the file has none. Variables have
    single precision, in which 99999.9 is another number."""
    fills = (*FILLS[key], *(() if fill is None else np.atleast_1d(fill).astype(float).tolist()))
    found = ~np.isfinite(column)
    for value in fills:
        found |= np.isclose(column, value, rtol=1e-6, atol=0.0)
    return found


def cadence_of(day: np.ndarray, second: np.ndarray, source: str) -> float:
    """The time between rows [s]: the most frequent one. Raises SceneError if it is none of OMNI's."""
    steps = 86400.0 * np.diff(day) + np.diff(second)
    values, counts = np.unique(np.round(steps, 3), return_counts=True)
    common = float(values[np.argmax(counts)]) if len(values) else float("nan")
    if common not in CADENCES:
        allowed = " or ".join(f"{x:g}" for x in CADENCES)
        got = f"those of {source} are mostly {common:g} s apart"
        raise SceneError(WIND_FILE, f"have rows {allowed} s apart (OMNI)", got)
    return common

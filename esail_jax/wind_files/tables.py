"""A measured wind from arrays in Python."""

from typing import Any

import numpy as np
from jaxtyping import Float

from esail_jax.calendar.instants import EPOCH, FIRST_DAYS, Instants, read_instant
from esail_jax.errors import SceneError
from esail_jax.wind_files.in_run import table_of_run
from esail_jax.wind_files.rows import Rows, check_increasing, is_fill


def wind(
    time: Any,
    speed: Any,
    number_density: Any,
    *,
    epoch: str | np.datetime64 | None = None,
    largest_gap: float | None = None,
) -> dict[str, Any]:
    """A measured wind as overrides of a scene: `esail.simulate(scene, esail.wind(time, speed, density))`.

    time, speed [m/s], number_density [1/m^3]: lists, arrays, Series of pandas or DataArrays of xarray of
    equal lengths; multiply km/s by 1e3 and 1/cm^3 by 1e6. time: increasing seconds of the run [s], or
    datetime64 values in UTC. epoch: the date of t = 0 for these, in the form of `initial.epoch`, such as
    "2027-03-01T12:00:00", or a datetime64 value in UTC. largest_gap: rows without a number (NaN, masked, or
    a fill value of OMNI) are left out, and the wind changes along a straight line, where the rows before
    and behind are at most so far apart [s]; None: they are refused.

    The result has `solar_wind.time`, `solar_wind.speed` and `solar_wind.number_density`, and with an epoch
    `initial.epoch`, to which they belong. Raises SceneError for numbers that are none, of which there are
    not equally many, or that are not positive; for times that do not increase; and for gaps that are
    longer."""
    epoch = None if epoch is None else str(epoch)
    times = instants_of(time, epoch)
    count = len(times.day) if isinstance(times, Instants) else len(times)
    columns = {
        "speed": numbers("speed", speed),
        "number_density": numbers("number_density", number_density),
    }
    missing = dict[int, str]()
    for name, column in columns.items():
        if len(column) != count:
            raise SceneError(name, f"have as many entries as `time` ({count})", f"has {len(column)}")
        column[is_fill(name, column)] = np.nan
        for index in np.flatnonzero(np.isinf(column) | (column <= 0.0))[:1]:
            raise SceneError(name, "be positive and finite", f"is {column[index]} at index {index}")
        absent = np.flatnonzero(np.isnan(column)).tolist()
        for index in {0, count - 1} & set(absent):
            raise SceneError(
                name, "have a number at its first and last instant", f"has none at index {index}"
            )
        missing |= dict.fromkeys(absent, f"no {name}")
    rows = Rows(
        source="`time`",
        form="table",
        time=times,
        speed=columns["speed"],
        number_density=columns["number_density"],
        line=np.arange(count),
        cadence=None,
        missing=missing,
        unit="index",
    )
    if largest_gap is not None and not largest_gap > 0.0:
        raise SceneError("largest_gap", "be positive", f"is {largest_gap}")
    start = None if epoch is None else read_instant(epoch, "epoch")
    table = table_of_run([check_increasing(rows)], start, None, largest_gap, "largest_gap")
    dated = {} if epoch is None else {EPOCH: epoch}
    return dated | {f"solar_wind.{name}": column for name, column in table.items()}


def numbers(name: str, values: Any) -> Float[np.ndarray, " row"]:
    """The numbers of a list, an array, a Series or a DataArray as an array of their own; masked ones are
    NaN. Raises SceneError for anything else."""
    try:
        array: np.ndarray = np.array(np.ma.filled(np.ma.array(values, dtype=float), np.nan))
    except (TypeError, ValueError) as error:
        raise SceneError(name, "be a list of numbers", wrong_entries(error)) from None
    if array.ndim != 1 or len(array) == 0:
        raise SceneError(name, "be a list of numbers", f"has the shape {array.shape}")
    return array


def wrong_entries(error: Exception) -> str:
    """What a list has in place of numbers, after the error of numpy. Values under a trace of JAX have no
    numbers yet; they may be overrides of a scene, such as `solar_wind.speed`."""
    return "is traced by JAX" if "traced" in str(error) else "has other entries"


def instants_of(time: Any, epoch: str | None) -> Float[np.ndarray, " row"] | Instants:
    """Times in seconds, or instants of the calendar of datetime64 values, which need an epoch. Raises
    SceneError."""
    zoned = getattr(getattr(time, "dtype", None), "tz", None) is not None  # pandas converts these to UTC
    try:
        array = np.asarray(time, "datetime64[ns]") if zoned else np.asarray(time)
    except TypeError as error:
        must = "be seconds or datetime64 values"
        raise SceneError("time", must, wrong_entries(error)) from None
    if array.dtype.kind == "M" and np.ma.is_masked(time):
        array = np.ma.filled(time, np.datetime64("NaT"))
    if array.dtype.kind != "M":
        if array.dtype.kind not in "iuf":
            raise SceneError(
                "time", "be seconds or datetime64 values", f"has entries of dtype {array.dtype}"
            )
        if epoch is not None:
            raise SceneError("epoch", "be left out with times in seconds", "is given")
        seconds = numbers("time", time)
        for index in np.flatnonzero(~np.isfinite(seconds))[:1]:
            raise SceneError("time", "be finite", f"is {seconds[index]} at index {index}")
        return seconds
    if epoch is None:
        raise SceneError("epoch", "be given with times of the calendar", "is missing")
    if array.ndim != 1 or len(array) == 0:
        raise SceneError("time", "be a list of instants", f"has the shape {array.shape}")
    for index in np.flatnonzero(np.isnat(array))[:1]:
        raise SceneError("time", "be finite", f"is NaT at index {index}")
    days = array.astype("datetime64[D]")
    part = (array - days).astype("timedelta64[ns]").astype(np.int64)
    return Instants((days - FIRST_DAYS).astype(int), part / 1e9, "UTC")

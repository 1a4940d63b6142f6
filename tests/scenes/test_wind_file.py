"""Tables of the wind in files: the line that is wrong is named, and nothing of it is guessed."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.scenes.loading import builtin_text
from esail_jax.wind_files.in_run import table_of_run
from esail_jax.wind_files.opening import read_rows

HEAD = "time,speed,number_density"
ROWS = ["0,4e5,7e6", "100,4.1e5,6e6", "200,3.9e5,5e6"]


def written(folder, lines, encoding="utf-8"):
    (folder / "wind.csv").write_text("\n".join(lines), encoding=encoding)
    table = table_of_run([read_rows("wind.csv", folder)])
    return {name: column.tolist() for name, column in table.items()}


def test_a_file_may_have_a_byte_order_mark_blanks_and_empty_lines(tmp_path):
    """Spreadsheet programs write the mark before the first name."""
    expected = {
        "time": [0.0, 100.0, 200.0],
        "speed": [4e5, 4.1e5, 3.9e5],
        "number_density": [7e6, 6e6, 5e6],
    }
    spaced = [HEAD.replace(",", " , "), "", *(row.replace(",", " , ") for row in ROWS), ""]
    assert written(tmp_path, spaced, "utf-8-sig") == expected
    other = ["speed,time,number_density", *(",".join(np.array(x.split(","))[[1, 0, 2]]) for x in ROWS)]
    assert written(tmp_path, other) == expected


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (
            "300,4e5,7e6,1",
            "`solar_wind.file` must have 3 numbers in every line, but line 5 of 'wind.csv' has 4",
        ),
        ("300,4e5", "`solar_wind.file` must have 3 numbers in every line, but line 5 of 'wind.csv' has 2"),
        ("300,fast,7e6", "`solar_wind.speed` must be finite, but line 5 of 'wind.csv' has 'fast'"),
        ("300,inf,7e6", "`solar_wind.speed` must be finite, but line 5 of 'wind.csv' has 'inf'"),
        (",4e5,7e6", "`solar_wind.time` must be finite, but line 5 of 'wind.csv' has ''"),
        (
            "200,4e5,7e6",
            "`solar_wind.time` must increase, but line 5 of 'wind.csv' is not later than line 4",
        ),
        ("300,-4e5,7e6", "`solar_wind.speed` must be positive, but line 5 of 'wind.csv' has '-4e5'"),
        (
            "300,4e5,-1",
            "`solar_wind.number_density` must not be negative, but line 5 of 'wind.csv' has '-1'",
        ),
    ],
)
def test_the_line_that_is_wrong_is_named(tmp_path, row, message):
    with pytest.raises(esail.SceneError) as error:
        written(tmp_path, [HEAD, *ROWS, row])
    assert str(error.value) == message


@pytest.mark.parametrize("head", ["time,speed,speed", f"{HEAD},time", "0,4e5,7e6"])
def test_each_column_is_given_once(tmp_path, head):
    with pytest.raises(
        esail.SceneError, match=r"must be a CSV file with the columns .*, but line 1 of 'wind.csv' has"
    ):
        written(tmp_path, [head, *ROWS])


def test_a_head_alone_is_no_wind(tmp_path):
    with pytest.raises(esail.SceneError, match="has no line of numbers"):
        written(tmp_path, [HEAD])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (-4e5, "`solar_wind.speed` must be positive, but is -400000.0 at index 499"),
        (np.nan, "`solar_wind.speed` must be finite, but is nan at index 499"),
    ],
)
def test_of_a_long_list_the_entry_that_is_wrong_is_shown(changed, message):
    speed = np.full(600, 4e5)
    speed[499] = changed
    with pytest.raises(esail.SceneError) as error:
        esail.load_scene(
            "baseline", {"solar_wind.time": np.linspace(0.0, 1e5, 600), "solar_wind.speed": speed}
        )
    assert str(error.value) == message


def test_of_a_long_table_the_instant_that_does_not_increase_is_shown():
    time = np.linspace(0.0, 1e5, 600)
    time[300] = time[299]
    with pytest.raises(esail.SceneError, match=r"`solar_wind.time` must increase, but is \S+ at index 300"):
        esail.load_scene("baseline", {"solar_wind.time": time})


def test_a_scene_may_have_a_byte_order_mark(tmp_path):
    (tmp_path / "sail.toml").write_text(builtin_text("baseline"), encoding="utf-8-sig")
    assert esail.load_scene(tmp_path / "sail.toml") == esail.load_scene("baseline")


def test_a_number_beside_a_file_among_the_overrides_is_refused(tmp_path):
    """It would be one of two values, and either choice a guess."""
    (tmp_path / "wind.csv").write_text("\n".join([HEAD, *ROWS]), encoding="utf-8")
    both = {"solar_wind.file": str(tmp_path / "wind.csv"), "solar_wind.speed": 3e5}
    with pytest.raises(esail.SceneError, match=r"must be left out with `solar_wind.file`, but is given"):
        esail.load_scene("truss", both)

"""`esail bench`: measures of error, and printed and written output. No run time is tested."""

import json

import numpy as np
import pytest

from esail_jax.cli import main
from esail_jax.commands import benchmark as bench
from esail_jax.scenes.loading import parse
from support import small_sail


def test_error_is_relative_to_the_range_over_time_and_components():
    """The range of all components together is 4, so that an error of 0.1 in any component counts as
    0.025."""
    exact = np.array([[0.0, 0.0], [1.0, 4.0], [0.5, 2.0]])
    for component in (0, 1):
        found = exact.copy()
        found[1, component] += 0.1
        assert bench.errors({"x": found}, {"x": exact}, ["x"])["x"] == pytest.approx(0.025)


def test_nearly_constant_signal_is_compared_with_its_magnitude():
    """A signal of range 1e-9 about 1000 has an effective range of 1e-3 x 1000; an error of 1e-3 counts as
    1e-3."""
    exact = 1000.0 + 1e-9 * np.arange(3)
    assert bench.errors({"x": exact + 1e-3}, {"x": exact}, ["x"])["x"] == pytest.approx(1e-3)


def test_angles_are_compared_modulo_a_turn():
    exact = np.array([0.0, 3.14, -3.14])
    turned = exact + np.array([0.0, 2 * np.pi, 0.0])
    names = ["euler_hub", "other"]
    errors = bench.errors(dict.fromkeys(names, turned), dict.fromkeys(names, exact), names)
    assert errors["euler_hub"] < 1e-15
    assert errors["other"] == pytest.approx(1.0, rel=1e-3)


def test_what_failed_is_worst():
    """A run that ended early has NaN rows, which count as an infinite error."""
    exact = {"a": np.arange(3.0), "b": np.arange(3.0)}
    found = {"a": exact["a"] + 9.0, "b": np.array([0.0, 1.0, np.nan])}
    errors = bench.errors(found, exact, exact)
    assert bench.worst(errors) == "b" and np.isnan(errors["b"])
    assert bench.worst({"a": 1.0, "b": 2.0}) == "b"


def test_reference_vouches_only_for_what_two_runs_agree_on():
    """Signals that are only rounding errors have a range, but two runs do not agree on them."""
    time = np.linspace(0.0, 1.0, 5)
    noise = 1e-18 * np.array([1.0, -2.0, 0.5, 1.5, -1.0])
    rows = {"x": time, "zero": noise, "energy_balance_error": time}
    best = bench.Run("m", "step", 0.1, rows, 1, 0.0, (1.0,))
    second = best._replace(rows=rows | {"x": time + 1e-9, "zero": -noise})
    assert bench.reference_of(best, second).names == ("x",)


def test_failed_run_is_a_row_with_its_message():
    """The JSON line of a failed run has null in place of NaN."""
    run = bench.Run("m", "step", 0.1, {}, 7, 0.0, (1.0,), message="It broke.")
    entry = bench.line(run, {"a": 1.0, "b": np.nan}, role="run")
    assert json.loads(json.dumps(entry, allow_nan=False))["errors"] == {"a": 1.0, "b": None}
    assert bench.table_row(entry)[-1] == "It broke."


def test_runs_that_agree_on_nothing_are_no_reference(monkeypatch):
    """The command ends with one line."""
    run = bench.Run(
        "m", "tolerance", 1e-13, {"x": np.array([0.0, np.nan])}, 7, 0.0, (1.0,), message="It broke."
    )
    monkeypatch.setattr(bench, "measure", lambda *_: run)
    with pytest.raises(bench.NoReference, match="It broke"):
        bench.reference_line(parse(small_sail.TEXT, "tiny"))
    assert main(["bench"]) == 3


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "tiny.toml"
    path.write_text(small_sail.TEXT.replace("interval = 0.35", "interval = 2.0"))
    return path


@pytest.mark.nightly
def test_table_and_lines(tiny, tmp_path, capsys, monkeypatch):
    """Every setting has a row and a JSON line, the reference first; collocation is the more accurate
    method.

    Its order is 7, that of the other method 2.
    """
    settings = [("generalized-alpha", "step", 0.1), ("collocation", "tolerance", 1e-10)]
    monkeypatch.setattr(bench, "SAIL", [(method, key, (value,)) for method, key, value in settings])
    file = tmp_path / "lines.jsonl"
    assert main(["bench", "--scene", str(tiny), "--t-end", "10", "--json", str(file)]) == 0
    rows = capsys.readouterr().out.splitlines()
    for method, key, value in settings:
        assert sum(row.split()[:3] == [method, key, f"{value:g}"] for row in rows) == 1
    lines = [json.loads(text) for text in file.read_text().splitlines()]
    assert [entry["role"] for entry in lines] == ["reference"] + ["run"] * len(settings)
    for entry, (method, key, value) in zip(lines[1:], settings, strict=True):
        assert (entry["method"], entry[key]) == (method, value)
    for entry in lines:
        assert entry["t_end"] == 10.0 and entry["versions"]["jax"] and entry["yardstick_gflops"] > 0.0
        assert entry["worst_error"] == max(entry["errors"].values()) > 0.0
        for sizes in (entry["equations"], entry["instructions"]):
            assert set(sizes) == {"start", "advance", "look"} and min(sizes.values()) > 100
    assert sum(row.startswith("equations (compiled instructions) of ") for row in rows) == 2
    tip = {(x["method"], x.get("step")): x["errors"]["tip_position_I"] for x in lines[1:]}
    assert tip["collocation", None] < 1e-2 * tip["generalized-alpha", 0.1]


def test_every_setting_can_be_run_on_what_it_is_for():
    """Every setting works for scenes that give a method, a step or a spectral radius themselves."""
    scene = parse(small_sail.TEXT.replace("step = 0.1", "step = 0.1\nspectral_radius = 0.5"), "tiny")
    for method, key, values in bench.SAIL:
        table = bench.with_method(scene, method, key, values[0]).integrator
        assert (table.method, getattr(table, key), table.spectral_radius) == (method, values[0], None)


@pytest.mark.parametrize(
    "arguments",
    [["--scene", "basline"], ["--t-end", "-1"], ["--t-end", "soon"], ["--scen", "baseline"], ["baseline"]],
)
def test_bad_input_is_answered_in_one_line(arguments, capsys):
    assert main(["bench", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1


def test_file_that_cannot_be_written(tiny, tmp_path, capsys):
    assert main(["bench", "--scene", str(tiny), "--json", str(tmp_path / "no" / "file")]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1

"""The date of a run and the dates of its wind: one moves with the other, or neither."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.scenes.loading import parse
from esail_jax.scenes.toml_text import to_toml
from support.bits import check_same, esail_run


def hourly(path, days):
    """A file of OMNI with the speed 400 + h km/s and the density 5 + h/10 per cm^3 in the hour h."""
    lines = []
    for day in range(days):
        for hour in range(24):
            words = ["9"] * 55
            words[:3] = "2027", str(60 + day), str(hour)
            words[23], words[24] = f"{5.0 + 0.1 * (24 * day + hour):.1f}", f"{400 + 24 * day + hour}."
            lines.append(" ".join(words))
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def scene(path, **overrides):
    given = {"solar_wind.file": path, "initial.epoch": "2027-03-01T06:00:00", "integrator.t_end": 7200.0}
    return esail.load_scene("truss", given | {"output.interval": 60.0} | overrides)


def test_the_wind_begins_at_the_date_of_the_run(tmp_path):
    """Day 60 of 2027 is the first of March. At six o'clock the wind is between those of the hours five and
    six, whose values stand at half past."""
    wind = scene(hourly(tmp_path / "omni2_2027.dat", 2)).solar_wind
    assert np.allclose(wind.time, [-1800.0, 1800.0, 5400.0, 9000.0])
    assert np.allclose(wind.speed, [405e3, 406e3, 407e3, 408e3])
    assert np.allclose(wind.number_density, [5.5e6, 5.6e6, 5.7e6, 5.8e6])


def test_another_date_takes_the_file_again(tmp_path):
    """With the file the wind moves; without it the times would stay where they were: that is refused."""
    path = hourly(tmp_path / "omni2_2027.dat", 3)
    first = scene(path)
    later = {"initial.epoch": "2027-03-02T06:00:00"}
    with pytest.raises(esail.SceneError, match=r"`initial.epoch` must be changed together with"):
        first.replace(later)
    moved = first.replace(later | {"solar_wind.file": path})
    assert np.allclose(moved.solar_wind.speed, np.asarray(first.solar_wind.speed) + 24e3)
    assert first.replace({"initial.epoch": "2027-03-01T06:00:00"}) == first
    with pytest.raises(esail.SceneError, match=r"`solar_wind.file` must have numbers from"):
        first.replace({"initial.epoch": "2027-04-01", "solar_wind.file": path})


def test_dates_of_toml_and_of_other_scales(tmp_path):
    """A date without quotes, and TDB: 69.184 s later than UTC in 2027, to 2 ms."""
    path = hourly(tmp_path / "omni2_2027.dat", 2)
    calm = {"solar_wind": None, "voltage": None, "integrator.t_end": 7200.0}
    text = to_toml(esail.load_scene("truss", calm))
    text = text.replace("[initial]\n", "[initial]\nepoch = 2027-03-01T06:00:00Z\n")
    text += f'[solar_wind]\nfile = "{path}"\ncutoff_voltage = 1e3\n[voltage]\nvalue = 2e4\n'
    wind = parse(text, "scene.toml").solar_wind
    assert np.allclose(wind.time, [-1800.0, 1800.0, 5400.0, 9000.0])
    tdb = scene(path, **{"initial.epoch": "2027-03-01T06:00:00 TDB"}).solar_wind
    assert np.allclose(tdb.time, np.array(wind.time) + 69.184, rtol=0.0, atol=2e-3)


@pytest.mark.nightly
def test_a_run_goes_on_with_later_rows_of_its_file(tmp_path, capsys):
    """The scene of a run that ended early has the rows that it needed; the longer one has more of the same
    file, and gives the bits of an uninterrupted run. Other rows are another scene."""
    path = hourly(tmp_path / "omni2_2027.dat", 2)
    text, whole, parts = (tmp_path / name for name in ("s.toml", "whole.h5", "parts.h5"))
    small = {"tethers.count": 2, "tethers.elements": 1, "output.interval": 300.0}
    first, last = (to_toml(scene(path, **small, **{"integrator.t_end": end})) for end in (1700.0, 7200.0))
    text.write_text(last)
    assert esail_run(text, whole) == 0
    text.write_text(first)
    assert esail_run(text, parts) == 0
    text.write_text(last)
    assert esail_run(text, parts, "--resume") == 0
    check_same(parts, whole)
    text.write_text(first)
    parts.unlink()
    assert esail_run(text, parts) == 0
    text.write_text(last.replace("406000.0", "406001.0"))
    assert esail_run(text, parts, "--resume") == 2
    assert "`solar_wind.speed` is 405000, 406000 in" in capsys.readouterr().err

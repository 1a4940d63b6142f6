"""The lagging oscillation after a gust, with constant voltages and with thrust that takes work out of it.

    python experiments/control/damping.py

writes damping.csv and damping.png.
"""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
from laws import Steering
from matplotlib.figure import Figure
from sail import CONSTANT, TURN, sail
from tables import write

import esail_jax as esail

HERE = Path(__file__).parent
DURATION = 20 * TURN
GUST = {
    "solar_wind.time": [0.0, 3600.0, 3660.0, 4260.0, 4320.0, DURATION],
    "solar_wind.speed": 4e5,
    "solar_wind.number_density": [7.3e6, 7.3e6, 2 * 7.3e6, 2 * 7.3e6, 7.3e6, 7.3e6],
}
"""The density doubles for ten minutes after an hour."""


def main():
    given = sail(DURATION, 15.0, 60.0) | {"tethers.count": 12} | GUST
    saved = ["lagging_angle", "coning_angle", "voltage"]
    table, lines = [], {}
    for damping in (None, 0.1, 0.3, 1.0, 3.0):
        law = None if damping is None else Steering(*jnp.array([0.0, 0.0, damping]))
        limits = CONSTANT if law is None else {}
        run = esail.simulate("baseline", given | limits, voltage_law=law, save=saved)
        lag, time = np.rad2deg(run["lagging_angle"]), run.time
        after = [(time > 3 * TURN) & (time < 6 * TURN), time > 17 * TURN]
        rms = [float(np.sqrt((lag[part] ** 2).mean())) for part in after]
        coning = np.rad2deg(run["coning_angle"])[after[1]].std(0).mean()
        change = float(np.abs(run["voltage"][time > 3 * TURN] / 20e3 - 1.0).max())
        label = "constant" if damping is None else f"{damping:g} s/m"
        table.append((label, *rms, float(coning), change))
        lines[label] = time / TURN, lag[:, 0]
        print(*table[-1], flush=True)
    header = (
        "damping",
        "rms lag, turns 3-6 [deg]",
        "rms lag, turns 17-20 [deg]",
        "coning about its mean, turns 17-20 [deg]",
        "largest voltage change after the gust",
    )
    write("damping.csv", header, table)
    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    axes = figure.subplots()
    for label, (turns, lag) in lines.items():
        axes.plot(turns, lag, label=label, lw=0.9)
    axes.axvspan(3600 / TURN, 4320 / TURN, color="0.9")
    axes.set(xlabel="turns", ylabel="lagging angle of tether 1 [deg]", xlim=(0, 20))
    axes.legend(fontsize=8, ncols=5)
    figure.savefig(HERE / "damping.png", dpi=150)


if __name__ == "__main__":
    main()

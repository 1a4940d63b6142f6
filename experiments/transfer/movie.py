"""A movie of the arcs of a year: the orbit with the spin plane, and the sail's angle, spin and cone.

    python experiments/transfer/movie.py [--frames 122]

reads the tables year-*.csv, which `run.py` writes, and writes year.webp. The sail in the
left picture is a line: its spin plane seen from the north pole of the ecliptic, enlarged 2e6 times.
"""

import argparse

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from run import HERE, tables_of

HALF_LENGTH = 0.13
"""Half the length [au] of the line that stands for the spin plane."""

EXTENT = -1.35, 1.35
"""Limits of the map [au]."""

COLOURS = {"outward": "#0072b2", "inward": "#d55e00"}
CURVES = {
    "angle_deg": "angle of the spin plane [deg]",
    "spin_mrad_s": "spin rate [mrad/s]",
    "coning_largest_deg": "largest coning angle [deg]",
}


class Movie:
    """Draws the arcs up to a day."""

    def __init__(self, tables):
        self.tables = tables
        self.figure = Figure(figsize=(8.4, 4.8), dpi=80, layout="constrained")
        FigureCanvasAgg(self.figure)
        grid = self.figure.add_gridspec(3, 2, width_ratios=(1.5, 1.0))
        self.map = self.figure.add_subplot(grid[:, 0])
        self.map.set(
            xlabel="x [au]", ylabel="y [au]", aspect="equal", xlim=(-1.35, 1.35), ylim=(-1.35, 1.35)
        )
        turn = np.linspace(0.0, 2.0 * np.pi, 361)
        self.map.plot(np.cos(turn), np.sin(turn), ":", color="0.6", linewidth=1.0)
        self.map.plot(0.0, 0.0, "o", color="#e69f00", markersize=11)
        self.panels = [self.figure.add_subplot(grid[k, 1]) for k in range(len(CURVES))]
        self.lines = {}
        for way, table in tables.items():
            colour = COLOURS[way]
            path, plane = (self.map.plot([], [], color=colour, linewidth=w)[0] for w in (1.2, 3.0))
            path.set_label(way)
            dots = []
            for panel, (name, label) in zip(self.panels, CURVES.items(), strict=True):
                panel.plot(table["day"], table[name], color=colour, linewidth=0.9)
                dots.append(panel.plot([], [], "o", color=colour, markersize=5)[0])
                panel.set_ylabel(label.replace(" [", "\n["), fontsize=8)
                panel.tick_params(labelsize=8)
            self.lines[way] = path, plane, dots
        self.panels[-1].set_xlabel("day")
        self.map.legend(loc="lower left", fontsize=8)

    def image(self, day):
        """The picture of a day: (height, width, 3) numbers of 8 bits."""
        self.map.set_title(f"Four 10 km tethers, 6 W, about the Sun: day {day:.0f}", fontsize=10)
        for way, (path, plane, dots) in self.lines.items():
            table = self.tables[way]

            def at(name, table=table):
                return np.interp(day, table["day"], table[name])

            so_far = table["day"] <= day
            path.set_data(table["x_au"][so_far], table["y_au"][so_far])
            along = np.array([-at("normal_y"), at("normal_x")])
            ends = np.outer([-HALF_LENGTH, HALF_LENGTH], along / np.linalg.norm(along))
            plane.set_data(at("x_au") + ends[:, 0], at("y_au") + ends[:, 1])
            for dot, name in zip(dots, CURVES, strict=True):
                dot.set_data([day], [at(name)])
        self.figure.canvas.draw()
        return np.asarray(self.figure.canvas.buffer_rgba())[..., :3].copy()


def main():
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--frames", type=int, default=122)
    frames = options.parse_args().frames
    tables = tables_of("year")
    movie = Movie(tables)
    last = min(table["day"][-1] for table in tables.values())
    images = [Image.fromarray(movie.image(day)) for day in np.linspace(0.0, last, frames)]
    images[0].save(
        HERE / "year.webp", "WEBP", save_all=True, append_images=images[1:], duration=66, loop=0, quality=60
    )


if __name__ == "__main__":
    main()

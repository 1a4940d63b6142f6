"""Controllability of the baseline by its voltages over one turn: the Gramian, and the cost of directions.

python experiments/controllability/run.py    # some minutes; writes costs, eigen, checks .csv, gramian.png
"""

import csv
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import esail_jax as esail
from esail_jax.design import plane_normals

HERE = Path(__file__).parent
TETHERS, SPIN, VOLTS = 12, 4e-3, 20e3
TURN = 2.0 * np.pi / SPIN  # s
SLOTS = 48
"""Intervals of a turn between which voltages run straight. Half as many show what is missed."""

ANGLES = (10.0, 0.0)
"""Sailing angles [deg]: of the baseline, and towards the Sun."""

TOLERANCE = 1e-8

PATTERNS = [("collective", np.ones(TETHERS))]
for wave in range(1, TETHERS // 2 + 1):
    angle = 2.0 * np.pi * wave * np.arange(TETHERS) / TETHERS
    PATTERNS.append((f"cos {wave}", np.cos(angle)))
    if wave < TETHERS // 2:
        PATTERNS.append((f"sin {wave}", np.sin(angle)))

OUTPUTS = ["tilt along the wind", "tilt across", "spin rate", *(f"lagging {name}" for name, _ in PATTERNS)]
UNITS = np.array([np.deg2rad(1.0)] * 2 + [0.01 * SPIN] + [np.deg2rad(1.0)] * len(PATTERNS))
"""One of each output: a degree of the spin plane's normal, a percent of the spin rate, a degree of lag."""


def outcome(table, sailing_deg):
    """The outputs at the end of a turn, in UNITS. table: voltages (instant, tether), parts of V_0.

    Tilts: of the spin plane's normal from the hub's axis at the start, towards larger sailing angles (in
    the plane of wind and axis) and across. Lagging: amplitudes of the patterns over the tethers.
    """
    run = esail.simulate("baseline", settings(len(table) - 1) | {
        "voltage.table": table, "initial.sailing_angle_deg": sailing_deg})  # fmt: skip
    rows = {name: jnp.asarray(x) for name, x in run.observables.items()}
    start = rows["rotation_IB"][0]
    normal = plane_normals(run)[-1]
    tilts = jnp.stack([-start[:, 2] @ normal, start[:, 1] @ normal])
    spin = rows["angular_velocity_B"][-1, :1]
    parts = jnp.stack([pattern / (pattern @ pattern) for _, pattern in PATTERNS])
    return jnp.concatenate([tilts, spin, parts @ rows["lagging_angle"][-1]]) / UNITS


def settings(slots: int) -> dict:
    """Overrides of the baseline."""
    return {
        "voltage.law": "piecewise-linear", "voltage.value": VOLTS,
        "voltage.time": np.linspace(0.0, TURN, slots + 1).tolist(),
        "integrator.t_end": TURN, "output.interval": TURN, "integrator.tolerance": TOLERANCE,
    }  # fmt: skip


def hat_masses(slots: int) -> np.ndarray:
    """M_kl = integral of h_k h_l dt [s] of the piecewise linear functions h_k of a turn."""
    width = TURN / slots
    masses = np.diag(np.full(slots + 1, 4.0)) + np.eye(slots + 1, k=1) + np.eye(slots + 1, k=-1)
    masses[0, 0] = masses[-1, -1] = 2.0
    return masses * width / 6.0


class Gramian:
    """W = int G G^T dt over a turn, where y = int G(t) dV(t) dt for small changes dV of voltages.
    The smallest rms change (over tethers and time) that reaches y is sqrt(y^T W^-1 y / (12 T)) volts."""

    def __init__(self, slopes: np.ndarray):
        # slopes: d outputs / d table (output, instant, tether).
        self.slopes = np.asarray(slopes) / VOLTS
        self.masses = hat_masses(slopes.shape[1] - 1)
        # G on the hat functions: what the response is to each of them, in their own inner product.
        self.kernel = np.linalg.solve(self.masses, self.slopes.swapaxes(0, 1).reshape(len(self.masses), -1))
        self.kernel = self.kernel.reshape(len(self.masses), len(OUTPUTS), TETHERS).swapaxes(0, 1)
        self.matrix = np.einsum("aki,bki->ab", self.slopes, self.kernel)

    def rms(self, energy: np.ndarray) -> np.ndarray:
        """Volts, of y^T W^-1 y [V^2 s]."""
        return np.sqrt(energy / (TETHERS * TURN))

    def alone(self) -> np.ndarray:
        """Volts for one unit of every output, whatever the others do."""
        return self.rms(1.0 / np.diag(self.matrix))

    def others_held(self) -> np.ndarray:
        """Volts for one unit of every output, the others left as they are."""
        return self.rms(np.diag(np.linalg.inv(self.matrix)))

    def directions(self) -> tuple[np.ndarray, np.ndarray]:
        """Volts of a unit along every eigenvector, the cheapest first, and the eigenvectors as columns."""
        values, vectors = np.linalg.eigh(self.matrix)
        return self.rms(1.0 / values[::-1]), vectors[:, ::-1]

    def change(self, y: np.ndarray, held: bool) -> np.ndarray:
        """The smallest change dV [V] (instant, tether) that reaches y; held: not what y is zero in."""
        used = np.ones(len(y), bool) if held else y != 0.0
        weights = np.zeros(len(y))
        weights[used] = np.linalg.solve(self.matrix[np.ix_(used, used)], y[used])
        return np.einsum("a,aki->ki", weights, self.kernel)


def coarser(slopes: np.ndarray) -> np.ndarray:
    """By the knots of half as many intervals, whose hats are h_2k + (h_2k-1 + h_2k+1) / 2."""
    even = slopes[:, ::2].copy()
    even[:, 1:] += 0.5 * slopes[:, 1::2]
    even[:, :-1] += 0.5 * slopes[:, 1::2]
    return even


def difference(sailing_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """A direction of the table, and the derivative along it by differences of fourth order."""
    along = np.random.default_rng(0).normal(size=(SLOTS + 1, TETHERS))
    ends = [np.asarray(outcome(1.0 + step * along, sailing_deg)) for step in (-4e-3, -2e-3, 2e-3, 4e-3)]
    return along, (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * 2e-3)


def check(found: Gramian, sailing_deg: float, reached: float) -> list[tuple]:
    """The smallest changes for a part `reached` of a unit, run: what they reach along the output, and the
    largest of what else they move, both over `reached`."""
    plain = np.ones(found.slopes.shape[1:])
    before = np.asarray(outcome(plain, sailing_deg))
    rows = []
    for i, name in enumerate(OUTPUTS[:4]):
        volts = found.change(reached * np.eye(len(OUTPUTS))[i], held=True)
        moved = (np.asarray(outcome(plain + volts / VOLTS, sailing_deg)) - before) / reached
        largest = np.abs(np.delete(moved, i)).max(), np.abs(volts).max()
        rows.append((name, float(moved[i]), *(float(x) for x in largest)))
    return rows


def draw(found: dict[float, Gramian]) -> Figure:
    """Costs by output, cost by eigenvector, and the cheapest voltages for a tilt and for spin."""
    figure = Figure(figsize=(13.0, 7.5), layout="constrained")
    costs, spectrum, *maps = figure.subplots(2, 3).ravel()
    at = np.arange(len(OUTPUTS))
    for k, (sailing, one) in enumerate(found.items()):
        label = f"sailing angle {sailing:g} deg"
        costs.barh(at + 0.4 * k - 0.2, one.others_held(), 0.4, label=label, color=f"C{k}")
        costs.plot(one.alone(), at + 0.4 * k - 0.2, "k|", ms=7.0)
        spectrum.semilogy(1 + at, one.directions()[0], "o-", color=f"C{k}", label=label)
    costs.set_yticks(at, OUTPUTS, fontsize=7)
    costs.invert_yaxis()
    costs.set_xscale("log")
    costs.set_xlabel("rms voltage for one degree, or 1 % of spin [V];\nbars: other outputs held, |: free")
    costs.legend(fontsize=6, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    spectrum.set_xlabel("eigenvector of the Gramian")
    spectrum.set_ylabel("rms voltage for one unit [V]")
    spectrum.legend(fontsize=7)
    spectrum.grid(alpha=0.3)
    first = next(iter(found.values()))
    for axis, i in zip(maps, (0, 1, 2, 3), strict=True):
        volts = first.change(np.eye(len(OUTPUTS))[i], held=True)
        limit = np.abs(volts).max()
        image = axis.imshow(volts.T, aspect="auto", cmap="RdBu_r", vmin=-limit, vmax=limit,
                            extent=(0.0, 1.0, TETHERS + 0.5, 0.5), interpolation="nearest")  # fmt: skip
        axis.set_title(f"cheapest voltages: {OUTPUTS[i]}", fontsize=8)
        axis.set_xlabel("turns")
        axis.set_ylabel("tether")
        figure.colorbar(image, ax=axis, label="V")
    return figure


def write(name: str, head: tuple, rows: list[tuple]) -> None:
    """A table as CSV, four digits."""
    with open(HERE / name, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(head)
        table.writerows([tuple(f"{x:.4g}" if isinstance(x, float) else x for x in row) for row in rows])


def main() -> None:
    """Compute, check, write."""
    began = time.perf_counter()
    jacobian = esail.jit(jax.jacrev(outcome))
    found, costs, eigen, checks = {}, [], [], []
    for sailing in ANGLES:
        slopes = np.asarray(jacobian(jnp.ones((SLOTS + 1, TETHERS)), sailing))
        print(f"{sailing:g} deg: {time.perf_counter() - began:.0f} s", flush=True)
        fine, coarse = Gramian(slopes), Gramian(coarser(slopes))
        found[sailing] = fine
        columns = (fine.alone(), fine.others_held(), coarse.others_held())
        costs += [(sailing, *row) for row in zip(OUTPUTS, *(map(float, x) for x in columns), strict=True)]
        volts, vectors = fine.directions()
        for k in range(len(volts)):
            parts = sorted(zip(np.abs(vectors[:, k]), OUTPUTS, strict=True), reverse=True)[:3]
            eigen.append((sailing, k + 1, float(volts[k]), *(f"{x:.2f} {name}" for x, name in parts)))
        checks += [(sailing, *row) for row in check(fine, sailing, 0.1)]
        along, quotient = difference(sailing)
        miss = np.abs(np.einsum("aki,ki->a", slopes, along) - quotient).max() / np.abs(quotient).max()
        print(f"reverse mode against differences, of the largest: {miss:.1e}", flush=True)
    write("costs.csv", ("sailing_deg", "output", "alone_V", "others_held_V", "others_held_coarse_V"), costs)
    write("eigen.csv", ("sailing_deg", "direction", "rms_V", "first", "second", "third"), eigen)
    write("checks.csv", ("sailing_deg", "output", "reached", "others_moved", "largest_V"), checks)
    draw(found).savefig(HERE / "gramian.png", dpi=110)
    print(f"{time.perf_counter() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()

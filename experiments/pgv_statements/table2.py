"""[PGV] Table 2: the frequencies of the paper beside those of the linearised sail.

    python experiments/pgv_statements/table2.py

Prints the table (ten seconds). `run.py` writes it into FIGURES.md, too. The frequencies are those of
`esail modes voltage-off`, the sail without thrust: with thrust at a sailing angle there is no equilibrium.
"""

import numpy as np

import esail_jax as esail

SCENE = "voltage-off"
PRINTED = {"spin": 6.37e-4, "first bending": 7.34e-3, "first axial": 2.17e-2}
"""Frequencies of Table 2 [Hz]."""

NOTE = """The frequencies of `esail modes` are moduli of the eigenvalues. The axial vibration is damped
(damping ratio 6.8 %), so a run rings at its modulus times sqrt(1 - 0.068^2). The printed bending frequency
does not hold: [errata](../paper_errata/ERRATA.md)."""


def span(modes, start: str) -> np.ndarray:
    """The frequencies [Hz] of the modes whose name begins with `start`."""
    return np.asarray(modes.frequency_hz)[[name.startswith(start) for name in modes.name]]


def rounded(values: np.ndarray) -> str:
    """The smallest and the largest of some frequencies, or one number if both are equal."""
    ends = [f"{value:.3e}" for value in (values.min(), values.max())]
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def table() -> str:
    """Table 2 as a table of Markdown."""
    modes = esail.modes(SCENE)
    axial = span(modes, "first axial")
    ringing = axial * np.sqrt(1.0 - np.max(modes.damping_ratio[np.isin(modes.frequency_hz, axial)]) ** 2)
    rows = [
        ("spin", rounded(np.array([modes.spin_rate / (2.0 * np.pi)])), "above the table: `spin`"),
        ("first bending", rounded(span(modes, "first in-plane bending")), "rows `first in-plane bending`"),
        (
            "first bending",
            rounded(span(modes, "first out-of-plane bending")),
            "rows `first out-of-plane bending`",
        ),
        ("first axial", rounded(axial), "rows `first axial`"),
        ("first axial", rounded(ringing), "rows `first axial`, as a run rings with its damping"),
    ]
    lines = [
        f"| Table 2 | printed [Hz] | ours [Hz] | where in the output of `esail modes {SCENE}` |",
        "|---|---|---|---|",
    ]
    lines += [f"| {name} | {PRINTED[name]:.2e} | {ours} | {line} |" for name, ours, line in rows]
    return "\n".join([*lines, "", NOTE]) + "\n"


if __name__ == "__main__":
    print(table())

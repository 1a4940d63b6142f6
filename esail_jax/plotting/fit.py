"""Figures of a fit: data with what the fitted run predicts, correlations, and error ellipses."""

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from esail_jax.identification.fit import Fit
from esail_jax.identification.telemetry import Telemetry, label_of
from esail_jax.observables import described
from esail_jax.plotting.panels import legend_above
from esail_jax.plotting.style import BLUE, RED, styled

MOST_PANELS = 8
"""Most columns of data that a figure shows."""

MOST_PAIRS = 15
"""Most pairs of parameters whose ellipses a figure shows."""

TURN = np.linspace(0.0, 2.0 * np.pi, 121)


def figures_of_fit(fit: Fit) -> Iterator[tuple[str, Figure]]:
    """Makes the figures of a fit, one after the other, each with its name."""
    for k, (data, residuals) in enumerate(zip(fit.data, fit.residuals, strict=True)):
        yield "data" + (f"_{k + 1}" if len(fit.data) > 1 else ""), data_figure(fit, data, residuals)
    if len(fit.parameters) > 1:
        yield "correlation", correlation_figure(fit)
        if np.isfinite(fit.sd).sum() > 1:
            yield "ellipses", ellipse_figure(fit)


@styled
def data_figure(fit: Fit, data: Telemetry, residuals: np.ndarray) -> Figure:
    """Measurements and prediction, on the left, and residuals in units of their noise, on the right, with
    the band of two standard deviations; of the first columns if there are many."""
    count = min(len(data.columns), MOST_PANELS)
    figure = Figure(figsize=(10.0, 1.2 + 1.9 * count), layout="constrained")
    axes = figure.subplots(count, 2, sharex=True, squeeze=False, width_ratios=(3.0, 2.0))
    minutes = data.time / 60.0
    order = np.argsort(minutes)
    noise = fit.problem.noise_of(data)
    for k, (column, (left, right)) in enumerate(zip(data.columns[:count], axes, strict=False)):
        measured = data.values[order, k]
        model = measured + residuals[order, k] * noise[k]
        known = np.isfinite(measured)
        left.plot(minutes[order][known], measured[known], ".", ms=3.0, color="0.6", label="measured")
        left.plot(minutes[order][known], model[known], color=BLUE, lw=1.0, label="fitted run")
        left.set_ylabel(f"{label_of(column)} [{described(column.name).unit}]".replace("_", " "), fontsize=8)
        left.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        right.axhspan(-2.0, 2.0, color=BLUE, alpha=0.12, lw=0.0)
        right.plot(minutes[order], residuals[order, k], ".", ms=3.0, color=BLUE)
        right.set_ylabel("residual / noise [-]", fontsize=8)
        for ax in (left, right):
            ax.grid(alpha=0.3)
    legend_above(axes[0, 0], 2)
    for ax in axes[-1]:
        ax.set_xlabel("t [min]")
    left_out = len(data.columns) - count
    more = f"; {left_out} more columns are not shown" if left_out else ""
    figure.suptitle(
        f"chi squared {fit.chi_squared:.5g}, {fit.degrees_of_freedom} degrees of freedom{more}",
        fontsize="medium",
    )
    return figure


@styled
def correlation_figure(fit: Fit) -> Figure:
    """The correlations of the estimates, as a matrix with numbers."""
    count = len(fit.parameters)
    side = 2.6 + 0.55 * count
    figure = Figure(figsize=(side + 1.2, side), layout="constrained")
    ax = figure.subplots()
    image = ax.imshow(fit.correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    for i in range(count):
        for j in range(count):
            value = fit.correlation[i, j]
            ax.text(
                j, i, f"{value:.2f}", ha="center", va="center", fontsize=7,
                color="white" if abs(value) > 0.6 else "black",
            )  # fmt: skip
    ax.set_xticks(range(count), fit.parameters, rotation=45, ha="right", fontsize=7)
    ax.set_yticks(range(count), fit.parameters, fontsize=7)
    figure.colorbar(image, ax=ax, label="correlation [-]", shrink=0.8)
    return figure


@styled
def ellipse_figure(fit: Fit) -> Figure:
    """Ellipses of one and two standard deviations of pairs of parameters that are seen, those with the
    strongest correlations first."""
    seen = np.flatnonzero(np.isfinite(fit.sd))
    pairs = [(i, j) for i in seen for j in seen if i < j]
    pairs = sorted(pairs, key=lambda pair: -abs(fit.correlation[pair]))[:MOST_PAIRS]
    columns = min(len(pairs), 3)
    rows = -(-len(pairs) // 3)
    figure = Figure(figsize=(3.6 * columns, 3.0 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for spare in axes[len(pairs) :]:
        spare.remove()
    for ax, (i, j) in zip(axes, pairs, strict=False):
        square = fit.covariance[np.ix_([i, j], [i, j])]
        values, vectors = np.linalg.eigh(square / np.outer(fit.sd[[i, j]], fit.sd[[i, j]]))
        half = vectors * np.sqrt(np.maximum(values, 0.0))
        circle = half @ np.stack([np.cos(TURN), np.sin(TURN)]) * fit.sd[[i, j]][:, None]
        for size, alpha in ((2.0, 0.15), (1.0, 0.3)):
            ax.fill(
                fit.values[i] + size * circle[0], fit.values[j] + size * circle[1], color=BLUE, alpha=alpha
            )
        ax.plot(fit.values[i], fit.values[j], "+", color=RED)
        ax.set_xlabel(f"{fit.parameters[i]} [{fit.units[i]}]", fontsize=7)
        ax.set_ylabel(f"{fit.parameters[j]} [{fit.units[j]}]", fontsize=7)
        ax.ticklabel_format(scilimits=(-3, 4), useMathText=True)
        ax.tick_params(labelsize=7)
        ax.grid(alpha=0.3)
    return figure

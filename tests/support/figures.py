"""Checks of figures."""

import numpy as np
from matplotlib.mathtext import MathTextParser


def check_axes(figure):
    """Every axis has a label with a unit that can be typeset, and every panel has a line."""
    for ax in figure.axes:
        assert ax.get_ylabel().endswith("]")
        MathTextParser("path").parse(ax.get_ylabel())
        if ax.get_label() != "<colorbar>":
            assert ax.get_xlabel().endswith("]") or shares_a_labelled_axis(ax)
            assert ax.lines


def shares_a_labelled_axis(ax):
    """Tells whether a panel further down in the same column has the same x axis and labels it."""
    left, bottom = ax.get_position().x0, ax.get_position().y0
    return any(
        other.get_xlabel().endswith("]")
        and np.isclose(other.get_position().x0, left, atol=0.01)
        and other.get_position().y0 < bottom
        for other in ax.get_shared_x_axes().get_siblings(ax)
    )


def panels(figure):
    return {ax.get_ylabel(): ax for ax in figure.axes}

"""The colours of the package's figures, from the style sheet `esail.mplstyle`."""

from pathlib import Path

from matplotlib import rc_context, rc_params_from_file

SHEET = rc_params_from_file(Path(__file__).with_name("esail.mplstyle"), use_default_template=False)

BLUE, ORANGE, RED, _, PURPLE, BROWN, *_ = SHEET["axes.prop_cycle"].by_key()["color"]
"""Colours of the cycle, by name."""

styled = rc_context(SHEET)
"""Decorator for a function that makes axes: lines without a colour of their own get those of the sheet."""

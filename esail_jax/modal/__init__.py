"""Modes of the sail of a scene: natural frequencies, damping ratios, names and shapes.

`modes(scene)` solves for the spinning equilibrium of the scene's sail (`steady_load.py`, `solving.py`),
selects the vibrations among the eigenvalues (`selection.py`), names them after their shapes (`names.py`,
`naming.py`), and returns a table (`table.py`). The mechanics are in `equilibria/`.
"""

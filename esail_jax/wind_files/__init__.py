"""Measured solar wind: files of OMNI and CSV files, tables in Python, their gaps, and the part of them
that a run needs. Scenes are read without JAX, and so are these files."""

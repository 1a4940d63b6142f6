"""Equilibria: the steady start, the steady flight of a spinning sail, and the vibration modes about it."""

"""Scenes: their parts with keys and checks (`parts.py`), and what is built from them."""

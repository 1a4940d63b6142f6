"""Pictures that move: a page for a browser (`page.py`) and an animation (`animation.py`) of what run files
hold. Nothing here imports JAX."""

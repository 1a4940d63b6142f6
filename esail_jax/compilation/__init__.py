"""Compilation: options, `jit`, and programs that are kept between processes."""

"""Docstrings of the package are plain text; Sphinx reads reStructuredText. This module converts them."""

import re


def to_rst(app, what, name, obj, options, lines) -> None:
    """Converts the lines of a docstring in place: an indented part becomes a literal block, and characters
    with a meaning in reStructuredText are escaped."""
    converted, literal = [], False
    for line in lines:
        indented = line.startswith("    ")
        if indented and not literal:
            converted += ["", "::", ""]
        if line.strip() and not indented and literal:
            converted.append("")
        literal = indented or (literal and not line.strip())
        converted.append(line if literal else escaped(line))
    lines[:] = converted


def escaped(line: str) -> str:
    """A line of text in which `code` is a literal and no other character has a meaning."""
    parts = re.split(r"`([^`]*)`", line)
    text = [re.sub(r"([\\*|_])", r"\\\1", part) for part in parts[::2]]
    code = [f"``{part}``" for part in parts[1::2]]
    return "".join(x for pair in zip(text, [*code, ""], strict=True) for x in pair)

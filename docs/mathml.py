"""Formulas as MathML, written when the site is built: a page then needs no program from another host to
show them. Every current browser draws MathML."""

import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

THIN = "0.167em"
"""Width of TeX's thin space, which stands about the name of a function."""

FUNCTIONS = "arccos|cos|sin|tan|exp|ln|log|max|min"


def mathml(formula: str, display: str) -> str:
    """A formula of LaTeX as MathML. Raises ValueError if a command is not known.

    Two spacings are those of TeX, not those of a browser: about the name of a function, unless a bracket
    follows, and within vertical bars, which a browser takes for a relation. Browsers draw no bold letters
    but those of Unicode, and a word is one identifier, not one for each letter."""
    text = convert(formula, display=display)
    unknown = re.findall(r"\\[A-Za-z]+", text)
    if unknown:
        raise ValueError(f"no MathML for {', '.join(unknown)} in {formula}")
    text = re.sub(
        rf"<(mi|mo)[^>]*>({FUNCTIONS})</\1>(?=((?:<mrow>)?<mo[^>]*>&#x00028;)?)",
        lambda name: f'<mo lspace="{THIN}" rspace="{"0" if name[3] else THIN}">{name[2]}</mo>',
        text,
    )
    text = re.sub(r'(?:<mi mathvariant="normal">\w</mi>){2,}', word, text)
    text = re.sub(r'<mi mathvariant="bold">([A-Za-z])</mi>', lambda x: f"<mi>{bold(x[1])}</mi>", text)
    bar = '<mo stretchy="false">&#x0007C;'
    return text.replace(bar, bar.replace(">", ' lspace="0" rspace="0">', 1))


def word(letters: re.Match) -> str:
    """Upright letters in a row as one identifier."""
    return f"<mi>{re.sub('<[^>]*>', '', letters[0])}</mi>"


def bold(letter: str) -> str:
    """The bold letter of mathematics for a letter of ASCII."""
    return chr((0x1D41A - ord("a") if letter.islower() else 0x1D400 - ord("A")) + ord(letter))


def write(translator: HTML5Translator, node: nodes.math | nodes.math_block, display: str) -> None:
    """Writes a formula. One that cannot be written is a warning, and so an error of the build."""
    try:
        translator.body.append(mathml(node.astext(), display))
    except Exception as error:
        logging.getLogger(__name__).warning("%s", error, location=node)


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    write(translator, node, "inline")
    raise nodes.SkipNode


def block(translator: HTML5Translator, node: nodes.math_block) -> None:
    translator.body.append('<div class="math">')
    write(translator, node, "block")
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}

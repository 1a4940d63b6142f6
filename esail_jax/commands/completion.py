"""`esail completion`: scripts with which a shell completes commands, options, scenes and files."""

import argparse
from pathlib import Path

import shtab

from esail_jax.commands.parser import parser
from esail_jax.scenes.builtin_scenes import builtin_names

FUNCTIONS = {
    "bash": '_esail_scene() {{ compgen -W "{names}" -- "$1"; compgen -f -- "$1"; }}',
    "zsh": "_esail_scene() {{ compadd {names}; _files }}",
}
"""Functions of the shells that complete the name of a built-in scene or the path of a file."""


def print_completion(shell: str) -> None:
    """Prints the completion script for a shell of `parser.SHELLS`."""
    names = builtin_names()
    top = parser()
    (commands,) = (action for action in top._actions if isinstance(action, argparse._SubParsersAction))
    for command in commands.choices.values():
        for action in command._actions:
            if action.dest == "scene":
                action.complete = shtab.FILE | {name: "_esail_scene" for name in FUNCTIONS}
            elif action.dest == "name":
                action.choices = names
            elif action.type is Path:
                action.complete = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE
    function = FUNCTIONS.get(shell, "").format(names=" ".join(names))
    print(shtab.complete(top, shell, preamble=function))

"""`esail completion`: scripts with which a shell completes commands, options, scenes and files."""

import argparse
from pathlib import Path

import shtab

from esail_jax.commands.parser import parser
from esail_jax.scenes.loading import builtin_names

FUNCTIONS = {
    "bash": '_esail_scene() {{ compgen -W "{names}" -- "$1"; compgen -f -- "$1"; }}',
    "zsh": "_esail_scene() {{ compadd {names}; _files }}",
    "fish": "function _esail_scene; printf '%s\\n' {names}; __fish_complete_path (commandline -ct); end",
}
"""Functions of the shells that complete the name of a built-in scene or the path of a file."""

SCENE = {"bash": "_esail_scene", "zsh": "_esail_scene", "fish": "(_esail_scene)"}
"""How each shell calls its function."""


def print_completion(shell: str) -> None:
    """Prints the completion script for a shell of `parser.SHELLS`."""
    names = builtin_names()
    top = parser()
    (commands,) = (action for action in top._actions if isinstance(action, argparse._SubParsersAction))
    for command in commands.choices.values():
        for action in command._actions:
            if action.dest == "scene":
                action.complete = SCENE
            elif action.dest == "name":
                action.choices = names
            elif action.type is Path:
                action.complete = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE
    function = FUNCTIONS[shell].format(names=" ".join(names))
    script = shtab.complete(top, shell, preamble=function)
    if shell == "zsh":
        # shtab's script completes only the first of several files. In zsh, "*:" stands for all of them.
        script = script.replace('"(*):', '"*:')
    print(script)

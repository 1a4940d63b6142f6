"""`esail completion`: scripts with which a shell completes commands, options, scenes and files."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, add_command

SHELLS = ("bash", "zsh", "fish")
"""Shells for which `esail completion` writes a script."""


FUNCTIONS = {
    "bash": '_esail_scene() {{ compgen -W "{names}" -- "$1"; compgen -f -- "$1"; }}',
    "zsh": "_esail_scene() {{ compadd {names}; _files }}",
    "fish": "function _esail_scene; printf '%s\\n' {names}; __fish_complete_path (commandline -ct); end",
}
"""Functions of the shells that complete the name of a built-in scene or the path of a file."""


SCENE = {"bash": "_esail_scene", "zsh": "_esail_scene", "fish": "(_esail_scene)"}
"""How each shell calls its function."""


def add(commands: Any) -> None:
    """Adds `esail completion`."""
    completion = add_command(
        commands,
        "completion",
        'print a script with which a shell completes command lines: eval "$(esail completion bash)"',
    )
    completion.add_argument("shell", choices=SHELLS, help="shell that reads the script")


def run(options: argparse.Namespace) -> ExitCode:
    """Prints the completion script for a shell of SHELLS."""
    import shtab

    from esail_jax.scenes.loading import builtin_names

    top, shell = options.parser, options.shell
    names = builtin_names()
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
    return ExitCode.DONE

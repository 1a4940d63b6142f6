"""Completion of command lines by the shell, with the script that `esail completion` prints."""

import shutil
import subprocess

import pytest

from esail_jax import cli
from esail_jax.commands.completion import SHELLS
from esail_jax.scenes.loading import builtin_names
from support.new_process import heavy_imports_of

PRESS_TAB = """
source "$1"
COMP_WORDS=("${@:2}")
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
_shtab_esail
printf '%s\\n' "${COMPREPLY[@]}"
"""
"""What bash does when the tab key is pressed after the words that follow the name of the script."""

TYPE_AND_PRESS_TAB = """
zmodload zsh/zpty
zpty terminal zsh -f -i
zpty -w terminal 'autoload -Uz compinit; compinit -u -D; eval "$(< esail.zsh)"'
zpty -w -n terminal "$1"$'\\t'
zpty -r -m terminal shown "*$2*"
"""
"""Starts an interactive zsh in a terminal, types the first argument and the tab key, and waits until the
terminal shows the second argument."""

COMPLETIONS = {
    "esail ru": {"run"},
    "esail run base": {"baseline", "baseless.toml"},
    "esail modes sun": {"sun-facing"},
    "esail init tru": {"truss"},
    "esail run --volt": {"--voltage-law"},
    "esail design --method ": {"lbfgs", "adam"},
    "esail plot first.h5 fir": {"first.h5"},
}
"""Typed text, and all words that may come in the place of its last word."""


def needs(shell):
    """Skips a test where the shell that runs the script is missing."""
    missing = shutil.which(shell) is None
    return pytest.mark.skipif(missing, reason=f"{shell}, which runs the script, is missing")


@pytest.fixture
def folder(tmp_path, capsys):
    """A folder with the scripts of all shells, a scene file and a run file."""
    for shell in SHELLS:
        assert cli.main(["completion", shell]) == 0
        (tmp_path / f"esail.{shell}").write_text(capsys.readouterr().out)
    (tmp_path / "baseless.toml").touch()
    (tmp_path / "first.h5").touch()
    return tmp_path


def output_of(folder, *command):
    """What a command prints that runs in a folder."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, timeout=300)
    return done.stdout


@needs("bash")
@pytest.mark.parametrize("typed", COMPLETIONS)
def test_bash_completes_commands_scenes_options_and_files(typed, folder):
    printed = output_of(folder, "bash", "-c", PRESS_TAB, "bash", "esail.bash", *typed.split(" "))
    assert set(printed.split()) == COMPLETIONS[typed]


@needs("fish")
@pytest.mark.parametrize("typed", COMPLETIONS)
def test_fish_completes_commands_scenes_options_and_files(typed, folder):
    command = f"source esail.fish; complete -C '{typed}'"
    lines = output_of(folder, "fish", "--no-config", "-c", command).splitlines()
    assert {line.split("\t")[0] for line in lines} == COMPLETIONS[typed]


@needs("zsh")
@pytest.mark.parametrize("typed", [typed for typed, words in COMPLETIONS.items() if len(words) == 1])
def test_zsh_completes_commands_scenes_options_and_files(typed, folder):
    before, _, _ = typed.rpartition(" ")
    (word,) = COMPLETIONS[typed]
    output_of(folder, "zsh", "-f", "-c", TYPE_AND_PRESS_TAB, "zsh", typed, f"{before} {word}")


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_names_all_commands_and_needs_no_heavy_library(shell, capsys):
    assert cli.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(name in script for name in (*cli.COMMANDS, *builtin_names()))
    assert heavy_imports_of(["completion", shell]) == (0, [])


def test_another_shell_is_refused_in_one_line(capsys):
    assert cli.main(["completion", "dash"]) == 2
    assert "invalid choice: 'dash'" in capsys.readouterr().err

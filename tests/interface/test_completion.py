"""Completion of command lines by the shell, with the script that `esail completion` prints."""

import shutil
import subprocess

import pytest

from esail_jax import cli
from esail_jax.commands.parser import SHELLS
from esail_jax.scenes.builtin_scenes import builtin_names
from support.new_process import heavy_imports_of

PRESS_TAB = """
source "$1"
COMP_WORDS=("${@:2}")
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
_shtab_esail
printf '%s\\n' "${COMPREPLY[@]}"
"""
"""What bash does when the tab key is pressed after the words that follow the name of the script."""


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash, which runs the script, is missing")
def test_bash_completes_commands_scenes_options_and_files(tmp_path, capsys):
    assert cli.main(["completion", "bash"]) == 0
    script, error = capsys.readouterr()
    assert error == ""
    (tmp_path / "esail.bash").write_text(script)
    (tmp_path / "baseless.toml").touch()
    (tmp_path / "first.h5").touch()

    def completed(*words):
        command = ["bash", "-c", PRESS_TAB, "bash", "esail.bash", "esail", *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        return set(done.stdout.split())

    assert completed("") >= set(cli.COMMANDS)
    assert completed("ru") == {"run"}
    assert completed("run", "base") == {"baseline", "baseless.toml"}
    assert completed("init", "") >= set(builtin_names())
    assert completed("run", "--volt") == {"--voltage-law"}
    assert completed("design", "--method", "") == {"lbfgs", "adam"}
    assert completed("plot", "first.h5", "fir") == {"first.h5"}


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_names_all_commands_and_needs_no_heavy_library(shell, capsys):
    assert cli.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(name in script for name in (*cli.COMMANDS, *builtin_names()))
    assert heavy_imports_of(["completion", shell]) == (0, [])


def test_another_shell_is_refused_in_one_line(capsys):
    assert cli.main(["completion", "dash"]) == 2
    assert "invalid choice: 'dash'" in capsys.readouterr().err

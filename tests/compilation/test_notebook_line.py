"""In a notebook a line says that the compiler is at work, and then how long it took."""

import sys
from types import SimpleNamespace

import pytest

from esail_jax.compilation import notebook_line
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.notebook_line import AT_WORK, NotebookLine, running_cell


class Output:
    """The output of the cells: a list of lines, each of which can be replaced."""

    def __init__(self):
        self.lines = []

    def show(self, text):
        place = len(self.lines)
        self.lines.append(text)

        def update(data, raw):
            assert raw
            self.lines[place] = data["text/plain"]

        return SimpleNamespace(update=update)


@pytest.fixture
def cell(monkeypatch):
    """A kernel that runs a cell; its number can be set. The line appears at once."""
    shell = SimpleNamespace(kernel=object(), execution_count=1)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setattr(notebook_line, "PATIENCE", 0.0)
    monkeypatch.setenv("ESAIL_CACHE", "off")
    return shell


@pytest.fixture
def output(monkeypatch):
    found = Output()
    monkeypatch.setattr(notebook_line, "show", found.show)
    return found


def wait_for_the_timer(line):
    line._timer.join(10.0)


def test_a_line_appears_and_then_has_the_time(cell, output):
    """Programs compiled at the same time and one after the other share the line of their cell. Its time is
    the sum of the waits, without what lies between them. Another cell has its own line."""
    line = NotebookLine()
    with line.shown():
        wait_for_the_timer(line)
        assert output.lines == [AT_WORK]
        with line.shown():
            pass
        assert output.lines == [AT_WORK]
    assert output.lines == ["Compiled in 0 s."]
    with line.shown():
        wait_for_the_timer(line)
        assert output.lines == [AT_WORK]
    assert output.lines == ["Compiled in 0 s."]
    cell.execution_count = 2
    with line.shown():
        wait_for_the_timer(line)
    assert len(output.lines) == 2


def test_time_of_several_waits_is_their_sum(cell, output, monkeypatch):
    """Waits from 0 to 3 s and from 10 to 14 s are 7 s of compiling."""
    line, now = NotebookLine(), [0.0]
    monkeypatch.setattr(notebook_line, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    for now[0], end in ((0.0, 3.0), (10.0, 14.0)):
        with line.shown():
            wait_for_the_timer(line)
            now[0] = end
    assert output.lines == ["Compiled in 7 s."]


def test_a_short_wait_is_silent(cell, output, monkeypatch):
    """Nothing appears for a program that compiles within PATIENCE, nor after it."""
    monkeypatch.setattr(notebook_line, "PATIENCE", 60.0)
    line = NotebookLine()
    with line.shown():
        pass
    wait_for_the_timer(line)
    assert output.lines == []


def test_the_cache_is_named_only_if_it_is_on(cell, output, monkeypatch, tmp_path):
    monkeypatch.setenv("ESAIL_CACHE", str(tmp_path))
    line = NotebookLine()
    with line.shown():
        wait_for_the_timer(line)
    assert output.lines == ["Compiled in 0 s, and kept for later sessions."]


def test_an_error_of_the_compiler_ends_the_line(cell, output):
    line = NotebookLine()
    with pytest.raises(ZeroDivisionError), line.shown():
        wait_for_the_timer(line)
        raise ZeroDivisionError
    assert output.lines == ["Compiled in 0 s."]


@pytest.mark.parametrize("shell", [None, SimpleNamespace(execution_count=3)])
def test_outside_notebooks_nothing_appears(shell, output, monkeypatch):
    """In a script, and in IPython on a terminal, which has no kernel."""
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    assert running_cell() is None
    with NotebookLine().shown():
        assert output.lines == []


def test_a_program_of_the_package_shows_the_line(cell, output):
    """Tracing and compiling a program is a wait. Running it again is none."""
    program = program_of(abs, (), (1.5,))

    def slowly(*arguments):
        wait_for_the_timer(notebook_line.compiler_at_work.__self__)
        return compiled(*arguments)

    compiled, program.program.compile = program.program.compile, slowly
    assert program(-2.5) == 2.5 and output.lines == ["Compiled in 0 s."]
    cell.execution_count = 2
    assert program(-3.5) == 3.5 and len(output.lines) == 1

"""A listener hears which program of a run is compiled or loaded."""

from esail_jax.compilation.announcements import announced_to
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.structure import split
from esail_jax.simulation import programs


def test_every_program_of_a_run_is_announced_in_order(monkeypatch):
    """The start, the time steps and the observables are announced before they are lowered, as "loading" if
    the cache has them."""
    kept = {programs.start: False, programs.advance_window: True, programs.look_at_points: False}

    class Recorded(Exception):
        """Ends the compilation after the last program."""

    def program_of(function, static, arguments, options):
        found = original(function, static, arguments, options)
        monkeypatch.setattr(type(found), "is_kept", kept[function])
        monkeypatch.setattr(type(found), "compile", lambda self: None)
        if function is not programs.look_at_points:
            monkeypatch.setattr(type(found), "lower", lambda self: None)
        else:
            monkeypatch.setattr(type(found), "lower", ended)
        return found

    def ended(self):
        raise Recorded

    original = programs.program_of
    monkeypatch.setattr(programs, "program_of", program_of)
    size = {"tethers.count": 3, "tethers.elements": 2, "integrator.method": "generalized-alpha"}
    structure, numbers = split(with_method(load_scene("baseline", size)))
    heard = []
    programs._compiled.cache_clear()
    with announced_to(heard.append):
        try:
            programs.compile_programs(structure, numbers)
        except Recorded:
            pass
    assert heard == [
        "compiling the program of the start ...",
        "loading the program of the time steps ...",
        "compiling the program of the observables ...",
    ]

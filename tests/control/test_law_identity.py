"""The checksum of a user's voltage law, by which a run file recognises it."""

import importlib.util

import pytest

from esail_jax.control import Delayed
from esail_jax.loads.law_structure import identity_of

TEXT = '''
import equinox as eqx

class Steady(eqx.Module):
    """A law."""

    gain: float = 2.0
    period: float = eqx.field(static=True, default=10.0)

    @property
    def base(self):
        return 20e3

    def commanded(self, measurements):
        return self.base * (1.0 + self.gain * measurements.time)  # V
'''


def made(text, folder):
    """The law of a file with this text."""
    path = folder / f"{abs(hash(text))}.py"
    path.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("laws", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Steady()


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("# V", "# volt", True),
        ("1.0 + self", "1.1 + self", False),
        ("gain: float = 2.0", "gain: float = 3.0", False),
        ("default=10.0", "default=20.0", False),
        ("return 20e3", "return 21e3", False),
    ],
    ids=["comment", "method", "number", "period", "property"],
)
@pytest.mark.parametrize("wrap", [lambda law: law, lambda law: Delayed(law, 1)], ids=["law", "wrapped law"])
def test_the_checksum_is_that_of_numbers_and_methods(old, new, same, wrap, tmp_path):
    """A law whose numbers, period or methods have changed is another law, also within a wrapper; one with
    another comment is not."""
    assert TEXT.count(old) == 1
    one, other = (identity_of(wrap(made(text, tmp_path))) for text in (TEXT, TEXT.replace(old, new)))
    assert (one == other) == same


def test_a_law_without_a_file_has_a_checksum():
    """Its methods cannot be read, as in a class that a program has made: the numbers are left."""
    names = {}
    exec(TEXT, names)
    law = names["Steady"]
    assert identity_of(law()) == identity_of(law()) != identity_of(law(3.0))

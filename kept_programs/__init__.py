r"""Programs of JAX that are compiled once, kept on the disk, and differentiated without being traced again.

    store = Store("mine/programs", "MINE_CACHE", b"mine\n")
    keeper = Keeper(store, Environment("mine", Path(__file__).parent, store), switch="MINE_PRIMITIVE")
    program = program_of(keeper, simulate, (), (state,))
    program(state)                                       # runs the executable
    jax.grad(lambda x: call(program, x).sum())(state)    # derivatives are kept programs, too

README.md tells how it works. Names are imported when they are used, so that a store can be looked at
without importing JAX.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kept_programs.calls import call, is_one_operation
    from kept_programs.keys import Environment, Unkeyed
    from kept_programs.program import Keeper, Program, TreeProgram, program_of, tree_program, type_of
    from kept_programs.remembered import clear_caches, remembered
    from kept_programs.store import Store, Usage

MODULES = {
    "calls": ("call", "is_one_operation"),
    "keys": ("Environment", "Unkeyed"),
    "program": ("Keeper", "Program", "TreeProgram", "program_of", "tree_program", "type_of"),
    "remembered": ("clear_caches", "remembered"),
    "store": ("Store", "Usage"),
}
"""The public names, by module."""

__all__ = [
    "Environment",
    "Keeper",
    "Program",
    "Store",
    "TreeProgram",
    "Unkeyed",
    "Usage",
    "call",
    "clear_caches",
    "is_one_operation",
    "program_of",
    "remembered",
    "tree_program",
    "type_of",
]


def __getattr__(name: str) -> Any:
    for module, names in MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

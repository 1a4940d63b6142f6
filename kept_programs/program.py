"""A program: a function of a list of arrays that is traced and compiled once, and kept on the disk.

Tracing and compiling take seconds, loading an executable takes tenths of a second. A program with a key
(`keys.py`) is therefore first looked for in the store (`store.py`). The types of its results are kept
beside it, because the next program may be compiled for them.
"""

import contextlib
import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from kept_programs.collector import collector_paused
from kept_programs.executables import compile_and_save, is_kept, load, load_executable, save
from kept_programs.keys import Environment, settings
from kept_programs.nan_checks import unchecked
from kept_programs.remembered import EXECUTABLES, remembered
from kept_programs.store import Store

Leaves = Sequence[Any]
"""Arrays, or numbers, in the order of a flattened tree."""


class Facts(NamedTuple):
    """What is known of a program without tracing it.

    results: types of the results; about: what the maker of the program has to remember beside them, such as
    the tree of the results."""

    results: tuple[jax.ShapeDtypeStruct, ...]
    about: Any


def lower_plainly(traced: jax.stages.Traced) -> jax.stages.Lowered:
    """Lowers a traced function."""
    return traced.lower()


def compile_plainly(lowered: jax.stages.Lowered) -> jax.stages.Compiled:
    """Compiles a lowered function with JAX's options."""
    return lowered.compile()


class Keeper(NamedTuple):
    """How the programs of a package are kept and compiled.

    store, environment: where they are kept, and what their keys depend on; lower: lowers a program that is
    compiled on its own; before_lowering: called before a program becomes part of a program of the user's,
    which it may refuse by an error; at_work: a context manager around everything that takes long; switch:
    the environment variable that lets programs be called through plain `jax.jit` if it is `off`; remedy:
    how a user clears the store."""

    store: Store
    environment: Environment
    lower: Callable[[jax.stages.Traced], jax.stages.Lowered] = lower_plainly
    before_lowering: Callable[[], None] = lambda: None
    at_work: Callable[[], contextlib.AbstractContextManager] = contextlib.nullcontext
    switch: str = "KEPT_PROGRAMS_PRIMITIVE"
    remedy: str = "clear it"


class Program:
    """A function of arrays, which is traced, loaded or compiled when it is needed first.

    make: returns the traced function and what is to be remembered of it (`Facts.about`); key: the name in
    the store, None if the program is not kept; compile: compiles what `Keeper.lower` returns; fixed: the
    number of its arguments before those in which it is linear, None if it is linear in none."""

    fixed: Callable[[], int] | None = None

    def __init__(
        self,
        keeper: Keeper,
        make: Callable[[], tuple[jax.stages.Traced, Any]],
        key: str | None,
        compile: Callable[[jax.stages.Lowered], jax.stages.Compiled] = compile_plainly,
    ):
        self.keeper, self.key, self._make, self.compile = keeper, key, make, compile
        self._lock, self._tracing = threading.RLock(), threading.RLock()
        self._settings = settings()
        self._made_of: tuple[jax.stages.Traced, Any] | None = None
        self._facts: Facts | None = None
        self._lowered: jax.stages.Lowered | None = None
        self._executable: Callable | None = None
        self._on_devices: Callable | None = None

    # Not `functools.cached_property`, which has one lock for all programs with Python 3.11: tracing one of
    # them may wait for another that a thread compiles.

    @property
    def _made(self) -> tuple[jax.stages.Traced, Any]:
        with self._tracing:
            if self._made_of is None:
                if settings() != self._settings:
                    self.key = None  # another program than the one with this key
                with self.keeper.at_work(), collector_paused():
                    self._made_of = self._make()
            return self._made_of

    @property
    def traced(self) -> jax.stages.Traced:
        """The traced function."""
        return self._made[0]

    @property
    def facts(self) -> Facts:
        """Types of the results, from the store if it has them."""
        with self._tracing:
            if self._facts is None:
                kept = load(self.keeper.store, self.key, "facts")
                self._facts = kept if isinstance(kept, Facts) else self._traced_facts()
            return self._facts

    def _traced_facts(self) -> Facts:
        traced, about = self._made
        results = tuple(
            jax.ShapeDtypeStruct(x.shape, x.dtype, weak_type=x.weak_type) for x in traced.jaxpr.out_avals
        )
        facts = Facts(results, about)
        save(self.keeper.store, self.key, "facts", facts)
        return facts

    @property
    def executable(self) -> Callable:
        """The executable, loaded or compiled. Other programs are compiled at the same time."""
        with self._lock:
            executable = self._executable
            if executable is None:
                executable = self._executable = self._loaded() or self._compiled()
        EXECUTABLES.use(self)
        return executable

    def on_devices(self, make: Callable[[], Callable]) -> Callable:
        """The function of `jax.jit` that runs the program on the devices of its arguments. make: returns
        it."""
        with self._lock:
            function = self._on_devices
            if function is None:
                function = self._on_devices = make()
        EXECUTABLES.use(self)
        return function

    def forget(self) -> None:
        """Lets the executable and the traced function go. They come back when they are needed."""
        self._executable = self._on_devices = self._made_of = None

    def _loaded(self) -> Callable | None:
        return load_executable(self.keeper.store, self.key) if self._lowered is None else None

    def _compiled(self) -> Callable:
        self.facts  # noqa: B018 - kept beside the executable
        with collector_paused():
            lowered = self._lowered or self.keeper.lower(self.traced)
        self._lowered = None
        with self.keeper.at_work():
            return compile_and_save(self.keeper.store, self.key, lambda: self.compile(lowered))

    def prepare(self) -> None:
        """Traces and lowers the program here, and starts to load or compile it in a thread, for which
        `executable` waits. An error of that thread comes up again there. The thread does not trace: it
        would do so with other settings of JAX, if these hold in the calling thread only."""

        def executable_now():
            with contextlib.suppress(Exception), self._lock:
                if self._lowered is not None:
                    self.executable  # noqa: B018
                elif self._executable is None:
                    self._executable = self._loaded()

        if self._executable is None:
            self.lower()
            threading.Thread(target=executable_now).start()

    def lower(self) -> None:
        """Traces and lowers the program, unless its executable is kept. Python runs this part of compiling
        in one thread at a time."""
        if self._lowered is None and not is_kept(self.keeper.store, self.key):
            with self._lock, self.keeper.at_work(), collector_paused():
                self._lowered = self.keeper.lower(self.traced)

    def __call__(self, *leaves: Any) -> Leaves:
        """Runs the program."""
        return unchecked(self.executable, *leaves)


class TreeProgram:
    """A program of a function of trees. function: that function, which `plain` computes through `jax.jit`;
    structure: that of the tuple of its arguments; types: of their leaves."""

    def __init__(self, program: Program, function: Callable, structure: Any, types: Sequence):
        self.program, self.function, self.structure, self.types = program, function, structure, types
        self.plain = jax.jit(function)

    @property
    def result(self) -> Any:
        """The result with types in place of arrays."""
        return self.unflatten(self.program.facts.results)

    @property
    def is_kept(self) -> bool:
        """True if the store has the executable."""
        return is_kept(self.program.keeper.store, self.program.key)

    def lower(self) -> None:
        """Traces and lowers the program, unless its executable is kept."""
        self.program.lower()

    def compile(self) -> None:
        """Loads or compiles the executable."""
        self.program.executable  # noqa: B018

    def leaves(self, arguments: tuple) -> Leaves:
        """The leaves of the arguments. Raises TypeError if they have another structure, or other
        types."""
        leaves, structure = jax.tree.flatten(arguments)
        if structure != self.structure:
            raise TypeError(f"the arguments must have the structure {self.structure}, but have {structure}")
        for x, expected in zip(leaves, self.types, strict=True):
            given = type_of(x)
            if (given.shape, given.dtype) != (expected.shape, expected.dtype):
                raise TypeError(f"an argument must be {text_of(expected)}, but is {text_of(given)}")
        return leaves

    def unflatten(self, results: Leaves) -> Any:
        """The tree of the results."""
        return jax.tree.unflatten(jax.tree.structure(self.program.facts.about), results)

    def __call__(self, *arguments: Any) -> Any:
        """Runs the program, or its function under `jax.disable_jit`."""
        if jax.config.jax_disable_jit:
            return self.function(*arguments)
        return self.unflatten(self.program(*self.leaves(arguments)))


def program_of(
    keeper: Keeper,
    function: Callable,
    static: tuple,
    arguments: tuple,
    compile: Callable[[jax.stages.Lowered], jax.stages.Compiled] = compile_plainly,
) -> TreeProgram:
    """The program of `function(*static, *arguments)`.

    function: of the keeper's package; static: hashable; arguments: trees of arrays, tracers or types;
    compile: hashable, and part of the key."""
    leaves, structure = jax.tree.flatten(arguments)
    values = tuple(map(value_of, static))
    kinds = tuple(map(type_of, leaves))
    return _program_of(keeper, function, static, values, structure, kinds, compile, settings())


def value_of(x: Any) -> Any:
    """What tells equal static values apart: types, and the sign of a zero."""
    if isinstance(x, tuple | list):
        return type(x), tuple(map(value_of, x))
    return type(x), repr(x) if isinstance(x, float | complex) else None


@remembered(maxsize=256)
def _program_of(keeper, function, static, values, structure, kinds, compile, settings) -> TreeProgram:
    arguments = jax.tree.unflatten(structure, kinds)
    places = jax.tree.unflatten(structure, range(len(kinds)))
    key = keeper.environment.key_of(function, static, places, kinds, compile)
    return tree_program(keeper, lambda *x: function(*static, *x), arguments, key, compile)


def tree_program(
    keeper: Keeper,
    function: Callable,
    arguments: tuple,
    key: str | None,
    compile: Callable[[jax.stages.Lowered], jax.stages.Compiled] = compile_plainly,
) -> TreeProgram:
    """The program of `function(*arguments)`. arguments: trees of types; key: name in the store."""
    types, structure = jax.tree.flatten(arguments)

    def make():
        skeleton = None

        def flat(*leaves):
            nonlocal skeleton
            result = function(*jax.tree.unflatten(structure, leaves))
            results, tree = jax.tree.flatten(result)
            skeleton = jax.tree.unflatten(tree, range(len(results)))
            return results

        return jax.jit(flat).trace(*types), skeleton

    return TreeProgram(Program(keeper, make, key, compile), function, structure, types)


def type_of(x: Any) -> jax.ShapeDtypeStruct:
    """Shape and type of an array, a tracer, a number or another type."""
    return jax.ShapeDtypeStruct(np.shape(x), jax.numpy.result_type(x))


def text_of(x: jax.ShapeDtypeStruct) -> str:
    """A type in words."""
    return f"{x.dtype}{list(x.shape)}"

"""A program: a function of a list of arrays that is traced and compiled once, and kept on the disk.

Tracing and compiling take seconds, loading an executable takes tenths of a second. A program with a key
(`keys.py`) is therefore first looked for in the program cache (`store.py`). The types of its results are
kept beside it, because the next program of a run is compiled for them.
"""

import contextlib
import functools
import pickle
import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.experimental import serialize_executable

from esail_jax.compilation import store
from esail_jax.compilation.cache_hits import HITS
from esail_jax.compilation.collector import collector_paused
from esail_jax.compilation.keys import key_of, settings
from esail_jax.compilation.memory import returning_freed_memory
from esail_jax.compilation.nan_checks import unchecked
from esail_jax.compilation.notebook_line import compiler_at_work
from esail_jax.compilation.options import COMPILER_OPTIONS, Options, compile_lowered, lower
from esail_jax.compilation.remembered import EXECUTABLES, remembered

Leaves = Sequence[Any]
"""Arrays, or numbers, in the order of a flattened tree."""


class Facts(NamedTuple):
    """What is known of a program without tracing it.

    results: types of the results; about: what the maker of the program has to remember beside them, such as
    the tree of the results."""

    results: tuple[jax.ShapeDtypeStruct, ...]
    about: Any


class Program:
    """A function of arrays, which is traced, loaded or compiled when it is needed first.

    make: returns the traced function and what is to be remembered of it (`Facts.about`); key: the name in
    the cache, None if the program is not kept; compile: compiles what `jax.stages.Traced.lower` returns;
    fixed: the number of its arguments before those in which it is linear, None if it is linear in none."""

    fixed: Callable[[], int] | None = None

    def __init__(
        self,
        make: Callable[[], tuple[jax.stages.Traced, Any]],
        key: str | None,
        compile: Callable[[jax.stages.Lowered], jax.stages.Compiled] = compile_lowered,
    ):
        self.key, self._make, self.compile = key, make, compile
        self._lock = threading.RLock()
        self._lowered: jax.stages.Lowered | None = None
        self._executable: Callable | None = None
        self._on_devices: Callable | None = None

    @functools.cached_property
    def _made(self) -> tuple[jax.stages.Traced, Any]:
        with compiler_at_work(), collector_paused():
            return self._make()

    @property
    def traced(self) -> jax.stages.Traced:
        """The traced function."""
        return self._made[0]

    @functools.cached_property
    def facts(self) -> Facts:
        """Types of the results, from the cache if it has them."""
        kept = load(self.key, "facts")
        if isinstance(kept, Facts):
            return kept
        traced, about = self._made
        results = tuple(
            jax.ShapeDtypeStruct(x.shape, x.dtype, weak_type=x.weak_type) for x in traced.jaxpr.out_avals
        )
        found = Facts(results, about)
        save(self.key, "facts", found)
        return found

    @property
    def executable(self) -> Callable:
        """The executable, loaded or compiled. Other programs are compiled at the same time: a
        `functools.cached_property` of Python 3.11 would have one lock for all of them."""
        with self._lock:
            found = self._executable
            if found is None:
                found = self._executable = self._loaded() or self._compiled()
        EXECUTABLES.use(self)
        return found

    def on_devices(self, make: Callable[[], Callable]) -> Callable:
        """The function of `jax.jit` that runs the program on the devices of its arguments. make: returns
        it."""
        with self._lock:
            found = self._on_devices
            if found is None:
                found = self._on_devices = make()
        EXECUTABLES.use(self)
        return found

    def forget(self) -> None:
        """Lets the executable and the traced function go. They come back when they are needed."""
        self._executable = self._on_devices = None
        self.__dict__.pop("_made", None)

    def _loaded(self) -> Callable | None:
        return load_executable(self.key) if self._lowered is None else None

    def _compiled(self) -> Callable:
        self.facts  # noqa: B018 - kept beside the executable
        with collector_paused():
            lowered = self._lowered or lower(self.traced)
        self._lowered = None
        return compile_and_save(self.key, lambda: self.compile(lowered))

    def prepare(self) -> None:
        """Traces and lowers the program here, and starts to load or compile it in a thread, for which
        `executable` waits. An error of that thread comes up again there."""

        def executable_now():
            with contextlib.suppress(Exception):
                self.executable  # noqa: B018

        if self._executable is None:
            self.lower()
            threading.Thread(target=executable_now).start()

    def lower(self) -> None:
        """Traces and lowers the program, unless its executable is kept. Python runs this part of compiling
        in one thread at a time."""
        if self._lowered is None and not is_kept(self.key):
            with self._lock, compiler_at_work(), collector_paused():
                self._lowered = lower(self.traced)

    def __call__(self, *leaves: Any) -> Leaves:
        """Runs the program."""
        return unchecked(self.executable, *leaves)


# ---- programs of functions of trees --------------------------------------------------------------


class TreeProgram:
    """A program of a function of trees. structure: that of the tuple of arguments."""

    def __init__(self, program: Program, structure: Any):
        self.program, self.structure = program, structure

    @functools.cached_property
    def _result(self) -> Any:
        return jax.tree.structure(self.program.facts.about)

    @property
    def result(self) -> Any:
        """The result with types in place of arrays."""
        return self.unflatten(self.program.facts.results)

    @property
    def is_kept(self) -> bool:
        """True if the cache has the executable."""
        return is_kept(self.program.key)

    def lower(self) -> None:
        """Traces and lowers the program, unless its executable is kept."""
        self.program.lower()

    def compile(self) -> None:
        """Loads or compiles the executable."""
        self.program.executable  # noqa: B018

    def leaves(self, arguments: tuple) -> Leaves:
        """Returns the leaves of the arguments. Raises TypeError if they have another structure."""
        leaves, structure = jax.tree.flatten(arguments)
        if structure != self.structure:
            raise TypeError(f"the arguments must have the structure {self.structure}, but have {structure}")
        return leaves

    def unflatten(self, results: Leaves) -> Any:
        """Returns the tree of the results."""
        return jax.tree.unflatten(self._result, results)

    def __call__(self, *arguments: Any) -> Any:
        """Runs the program."""
        return self.unflatten(self.program(*self.leaves(arguments)))


def program_of(
    function: Callable,
    static: tuple,
    arguments: tuple,
    options: Options = COMPILER_OPTIONS,
    fused: bool = True,
) -> TreeProgram:
    """Returns the program of `function(*static, *arguments)`.

    function: of this package; static: hashable; arguments: trees of arrays, tracers or types; fused:
    whether the library may compute the operations around matrix products (`options.compile_lowered`)."""
    leaves, structure = jax.tree.flatten(arguments)
    given = tuple(options.items())
    return _program_of(function, static, structure, tuple(map(type_of, leaves)), given, fused, settings())


@remembered(maxsize=256)
def _program_of(function, static, structure, kinds, options, fused, settings) -> TreeProgram:
    arguments = jax.tree.unflatten(structure, kinds)
    leaves = range(len(kinds))
    key = key_of(function, static, jax.tree.unflatten(structure, leaves), kinds, options, fused)
    return tree_program(lambda *x: function(*static, *x), arguments, key, dict(options), fused)


def tree_program(
    function: Callable,
    arguments: tuple,
    key: str | None,
    options: Options = COMPILER_OPTIONS,
    fused: bool = True,
) -> TreeProgram:
    """Returns the program of `function(*arguments)`. arguments: trees of types; key: name in the cache;
    options and fused: as for `program_of`."""
    types, structure = jax.tree.flatten(arguments)

    def make():
        skeleton = None

        def flat(*leaves):
            nonlocal skeleton
            result = function(*jax.tree.unflatten(structure, leaves))
            found, tree = jax.tree.flatten(result)
            skeleton = jax.tree.unflatten(tree, range(len(found)))
            return found

        return jax.jit(flat).trace(*types), skeleton

    def compile_now(lowered):
        if fused:
            return compile_lowered(lowered, options)
        return lowered.compile(compiler_options=options)

    return TreeProgram(Program(make, key, compile_now), structure)


def type_of(x: Any) -> jax.ShapeDtypeStruct:
    """Returns shape and type of an array, a tracer, a number or another type."""
    return jax.ShapeDtypeStruct(np.shape(x), jax.numpy.result_type(x))


# ---- the cache -----------------------------------------------------------------------------------


def load(key: str | None, kind: str) -> Any:
    """Returns an object from the cache, or None."""
    data = None if key is None else store.load(f"{key}-{kind}")
    if data is None:
        return None
    with contextlib.suppress(Exception):  # from other versions of a library, for example
        return pickle.loads(data)
    return None


def save(key: str | None, kind: str, value: Any) -> None:
    """Writes an object to the cache."""
    if key is not None:
        store.save(f"{key}-{kind}", pickle.dumps(value))


def is_kept(key: str | None) -> bool:
    """Tells whether the cache has a file for this executable."""
    return key is not None and store.has(f"{key}-executable")


@returning_freed_memory()
def load_executable(key: str | None, trees: tuple | None = None) -> Callable | None:
    """Returns an executable from the cache, or None. trees: structures of arguments and results, if these
    are not lists of arrays."""
    kept = load(key, "executable")
    if kept is None:
        return None
    with contextlib.suppress(Exception):  # of another version of XLA, for example
        serialised, arguments, results = kept
        if LAPACK in serialised:
            connect_lapack()
        if trees is None:
            trees = jax.tree.structure(((0,) * arguments, {})), jax.tree.structure([0] * results)
        return serialize_executable.deserialize_and_load(serialised, *trees)
    return None


LAPACK = b"lapack_"
"""First letters of the names under which an executable calls LAPACK."""


def connect_lapack() -> None:
    """Gives jaxlib the addresses of SciPy's LAPACK. JAX does so when it lowers a program that needs them.
    An executable that is loaded without them ends the process."""
    from jaxlib import lapack

    lapack.prepare_lapack_call("getrf_ffi", np.dtype(float))


@returning_freed_memory()
def compile_and_save(key: str | None, compile: Callable[[], jax.stages.Compiled]) -> jax.stages.Compiled:
    """Compiles a program and writes its executable to the cache.

    Executables for several devices are not kept. Neither are those that JAX has loaded from its own
    compilation cache: XLA serialises them without some of their functions."""
    hits = HITS.count
    with compiler_at_work():
        compiled = compile()
    if key is None or jax.device_count() > 1 or HITS.count > hits or store.location() is None:
        return compiled
    with contextlib.suppress(Exception):  # some programs cannot be serialised
        serialised, arguments, results = serialize_executable.serialize(compiled)
        save(key, "executable", (serialised, arguments.num_leaves, results.num_leaves))
    return compiled

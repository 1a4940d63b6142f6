"""Functions compiled with this package's options: `jit` for programs, `traced_once` for their parts."""

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import Any

import jax

from esail_jax.compilation.kept import KEEPER, key_of
from esail_jax.compilation.notebook_line import compiler_at_work
from esail_jax.compilation.options import COMPILER_OPTIONS, compiled, compiled_by_us, lower
from esail_jax.compilation.stored import STORE
from kept_programs.calls import is_one_operation
from kept_programs.collector import collector_paused
from kept_programs.executables import compile_and_save, load_executable


def traced_once(static_argnums: Sequence[int] = ()) -> Callable[[Callable], Callable]:
    """A decorator for a function that is part of several programs. JAX traces the function once for
    arguments of the same structure and shapes, and copies the equations into every program."""

    def decorate(f: Callable) -> Callable:
        traced = jax.jit(f, static_argnums=static_argnums, inline=True)

        @functools.wraps(f)
        def call(*arguments):
            # JAX's cache distinguishes between no mesh and an empty mesh, which derivatives set.
            with jax.sharding.use_abstract_mesh(jax.sharding.get_abstract_mesh()):
                return traced(*arguments)

        return call

    return decorate


def jit(
    f: Callable[..., Any],
    *,
    static_argnums: int | Sequence[int] = (),
    static_argnames: str | Sequence[str] = (),
) -> "CompiledFunction":
    """A function that computes what `jax.jit(f)` computes, compiled with this package's options.

    On a CPU a program with a run inside takes a tenth to a fifth less time to compile than under `jax.jit`,
    and about as long to run. Every combination of tree structure, shapes, types and static values of
    the arguments is compiled at its first call, ahead of time. `static_argnums` and `static_argnames` are
    those of `jax.jit`.

    JAX accepts compiler options only for a whole program. A call with traced arguments, inside `jax.grad`,
    `jax.vmap` or another `jax.jit`, is therefore the same as a call of `jax.jit(f)`. To compile a
    derivative with the options, write `jit(jax.grad(f))` and not `jax.grad(jit(f))`.

    Programs are kept in the program cache. A later process traces `f`, but not the runs inside: these are
    represented by their keys (`kept_programs/calls.py`).
    """
    return CompiledFunction(f, static_argnums, static_argnames)


class CompiledFunction:
    """A function as `jit` returns it."""

    def __init__(
        self,
        f: Callable[..., Any],
        static_argnums: int | Sequence[int] = (),
        static_argnames: str | Sequence[str] = (),
    ):
        functools.update_wrapper(self, f)
        self._static = static_arguments(f, static_argnums, static_argnames)
        numbers, names = self._static
        # All arguments stay: the key of a kept program is its text, which must tell which of them it uses.
        self._jitted = jax.jit(f, static_argnums=numbers, static_argnames=names, keep_unused=True)
        self._programs: dict[Any, Callable[..., Any]] = {}

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        dynamic, static = split_arguments(args, kwargs, *self._static)
        leaves, tree = jax.tree.flatten(dynamic)
        if not is_compiled_here(leaves):
            return self._jitted(*args, **kwargs)
        try:
            values = tuple((place, type(value), value) for place, value in static.items())
            key = tree, values, tuple(map(type_of, leaves))
            program = self._programs.get(key)
        except TypeError:
            # A static value is not hashable, or an argument is no array: `jax.jit` raises the right error.
            return self._jitted(*args, **kwargs)
        if program is None:
            with compiler_at_work(), collector_paused(), compiled_by_us():
                traced = self._jitted.trace(*args, **kwargs)
            if len(traced.jaxpr.in_avals) != len(leaves):
                # `f` encloses traced values, which have become inputs of the program.
                return self._jitted(*args, **kwargs)
            program = self._programs[key] = compile_traced(traced)
        return program(*dynamic[0], **dynamic[1])

    def __get__(self, instance: Any, owner: type | None = None) -> Callable[..., Any]:
        """The function as a method of an instance."""
        return self if instance is None else functools.partial(self, instance)

    def lower(self, *args: Any, **kwargs: Any) -> jax.stages.Lowered:
        """Lowers the function for the given arguments, as `jax.jit(f).lower` does."""
        return self._jitted.lower(*args, **kwargs)

    def clear_cache(self) -> None:
        """Forgets all compiled programs."""
        self._programs.clear()
        self._jitted.clear_cache()


def compile_traced(traced: jax.stages.Traced) -> Callable:
    """Compiles a traced function, or loads it from the program cache. Its key is the text of the lowered
    function, in which the programs of this package are represented by their keys."""
    key = None
    if STORE.location() is not None and is_one_operation(KEEPER):
        from kept_programs.operation import text_with_keys

        with collector_paused():
            named = text_with_keys(traced)
        key = key_of("lowered", named.as_text(), COMPILER_OPTIONS)
        executable = load_executable(STORE, key, (named.in_tree, named.out_tree))
        if executable is not None:
            return executable
    with compiler_at_work():
        with collector_paused():
            lowered = lower(traced)
        return compile_and_save(STORE, key, lambda: compiled(lowered, COMPILER_OPTIONS))


def is_compiled_here(leaves: list[Any]) -> bool:
    """Tells whether a call with these arguments runs a program of its own on a CPU."""
    return (
        not any(isinstance(x, jax.core.Tracer) for x in leaves)
        and not jax.config.jax_disable_jit
        and jax.default_backend() == "cpu"
    )


def type_of(x: Any) -> tuple[Any, Any]:
    """The properties of an argument for which a program is compiled: shape and type, and the
    devices of a JAX array. Raises TypeError if the argument is no array or number."""
    return jax.typeof(x), x.sharding if isinstance(x, jax.Array) else None


def static_arguments(
    f: Callable[..., Any], numbers: int | Sequence[int], names: str | Sequence[str]
) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Positions and names of all static arguments. If only one of them is given, the other follows
    from the signature of `f`, as for `jax.jit`."""
    numbers = (numbers,) if isinstance(numbers, int) else tuple(numbers)
    names = (names,) if isinstance(names, str) else tuple(names)
    if bool(numbers) == bool(names):
        return numbers, names
    try:
        parameters = list(inspect.signature(f).parameters.values())
    except (TypeError, ValueError):
        return numbers, names
    positional = [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
    first = sum(p.kind is p.POSITIONAL_ONLY for p in parameters)
    if numbers:
        count = first + len(positional)
        places = (n % count if n < 0 else n for n in numbers)
        return numbers, tuple(positional[n - first] for n in places if first <= n < count)
    return tuple(first + k for k, name in enumerate(positional) if name in names), names


def split_arguments(
    args: tuple[Any, ...], kwargs: dict[str, Any], numbers: tuple[int, ...], names: tuple[str, ...]
) -> tuple[tuple[tuple[Any, ...], dict[str, Any]], dict[int | str, Any]]:
    """The traced arguments, positional and by name, and the static ones by position or name."""
    places = {n % len(args) if n < 0 else n for n in numbers} if args else set()
    traced = tuple(x for n, x in enumerate(args) if n not in places)
    by_name = {name: x for name, x in kwargs.items() if name not in names}
    static: dict[int | str, Any] = {n: x for n, x in enumerate(args) if n in places}
    static |= {name: kwargs[name] for name in sorted(kwargs) if name in names}
    return (traced, by_name), static

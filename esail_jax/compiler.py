"""How the package's own programs are compiled for a CPU.

A program around `simulate` gets the same by `esail_jax.compiled(jax.jit(f).lower(*arguments))`, a `jax.jit`
most of it by `jax.jit(f, compiler_options=esail_jax.COMPILER_OPTIONS)`.

The compiler hands matrix products to a library. Let that have the reshaping and copying around a product,
too, and a step of the baseline takes a fifth less time. But the library of jaxlib 0.10.2 reads a right
factor whose columns are all equal from beyond its end (`uniform_factor`): rarely part of a run, often of a
derivative, where a tangent is zero. `compiled` looks whether a program has such a product.
"""

import re

import jax

FUSION_TYPE = "xla_cpu_experimental_ynn_fusion_type"
NAMED = jax.__version_info__ < (0, 11)
"""Later versions of JAX have options of other names."""

COMPILER_OPTIONS = (
    {FUSION_TYPE: "LIBRARY_FUSION_TYPE_INDIVIDUAL_DOT", "xla_cpu_use_fusion_emitters": False}
    if NAMED
    else None
)
"""Only matrix products go to the library, nothing around them. By default it takes sums over the three
components, too: the baseline's run takes an eighth more time, and an iteration of sixteen sails in lockstep
half as much again. And loops as XLA used to write them for the CPU: they are as fast here, and take a third
less compile time."""

TOGETHER = {FUSION_TYPE: "LIBRARY_FUSION_TYPE_DOT"}
"""Matrix products with what stands around them."""


def with_options(**more: str | bool | int) -> dict[str, str | bool | int] | None:
    """Those and more."""
    return None if COMPILER_OPTIONS is None else COMPILER_OPTIONS | more


CHAIN_COMPILE = with_options(**{FUSION_TYPE: ""})
"""Of chains by explicit methods: nothing goes to the library, whose small products make a run of two
bodies joined by ten rods 1.8 times as long."""

ROWS_COMPILE = with_options(xla_backend_optimization_level=1)
"""Of looks at saved instants: another fifth less, and as fast."""

ONCE_COMPILE = with_options(xla_backend_optimization_level=0)
"""Of what runs once, the start of a run: a quarter of the time, 0.8 for 3.1 s."""

COMPUTATION = re.compile(r"^(%\S+) \([^\n]*\{\n((?: [^\n]*\n)+)\}", re.MULTILINE)
"""Name and instructions."""

INSTRUCTION = re.compile(r"^ *(?:ROOT )?(%\S+) = \S+ ([\w-]+)\((.*?)\)", re.MULTILINE)
"""Name, operation and inputs."""

RESHAPING = ("bitcast", "reshape", "transpose", "copy")
STORED = ("parameter", "constant", "dot")
"""What stands in memory in full."""


def compiled(
    lowered: jax.stages.Lowered, options: dict[str, str | bool | int] | None = COMPILER_OPTIONS
) -> jax.stages.Compiled:
    """A lowered program compiled: `compiled(jax.jit(f).lower(*arguments))(*arguments)`.

    Products and what stands around them go to the library if that is right for all of them, products alone
    if not (`uniform_factor`). options: beside that."""
    if options is not None:
        program = lowered.compile(compiler_options=options | TOGETHER)
        if not uniform_factor(program.as_text()):
            return program
    return lowered.compile(compiler_options=options)


def uniform_factor(program: str) -> bool:
    """Has the text of a compiled program a product in the library whose right factor is, seen through
    reshaping, not an array in memory? The library errs on some broadcasts; whatever else is refused too."""
    in_library = set(re.findall(r"kind=kCustom, calls=(%[\w.-]+).*__ynn_fusion", program))
    for name, body in COMPUTATION.findall(program):
        if name in in_library and product_of_unstored(body):
            return True
    return False


def product_of_unstored(body: str) -> bool:
    """Is the right factor of a product not an array in memory, in the text of one computation?"""
    made = {name: (op, inputs) for name, op, inputs in INSTRUCTION.findall(body)}
    for op, inputs in made.values():
        if op == "dot":
            op, inputs = made[last(inputs)]
            while op in RESHAPING:
                op, inputs = made[last(inputs)]
            if op not in STORED:
                return True
    return False


def last(inputs: str) -> str:
    """Name of the last input, which may follow its type."""
    return inputs.split(",")[-1].split()[-1]

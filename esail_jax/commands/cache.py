"""`esail cache`."""

from esail_jax.compilation.stored import STORE

UNITS = {"GiB": 2**30, "MiB": 2**20, "KiB": 2**10}
"""Units of a size, largest first."""


def show_cache(clear: bool) -> None:
    """Prints where compiled programs are kept, their number and size. clear: removes them."""
    folder = STORE.location()
    if folder is None:
        print(f"Compiled programs are not kept ({STORE.variable} is off).")
        return
    found = STORE.usage()
    print(f"folder    {folder}")
    print(f"files     {found.files}")
    print(f"size      {in_words(found.size)} (at most {in_words(STORE.most_bytes)})")
    if clear:
        print(f"removed   {STORE.clear()}")


def in_words(size: int) -> str:
    """Returns a size with its unit."""
    for unit, value in UNITS.items():
        if size >= value:
            return f"{size / value:.1f} {unit}"
    return f"{size} B"

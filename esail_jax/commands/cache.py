"""`esail cache`."""

from esail_jax.compilation import store

UNITS = {"GiB": 2**30, "MiB": 2**20, "KiB": 2**10}
"""Units of a size, largest first."""


def show_cache(clear: bool) -> None:
    """Prints where compiled programs are kept, their number and size. clear: removes them."""
    folder = store.location()
    if folder is None:
        print(f"Compiled programs are not kept ({store.VARIABLE} is off).")
        return
    found = store.usage()
    print(f"folder    {folder}")
    print(f"files     {found.files}")
    print(f"size      {in_words(found.size)} (at most {in_words(store.MOST_BYTES)})")
    if clear:
        print(f"removed   {store.clear()}")


def in_words(size: int) -> str:
    """Returns a size with its unit."""
    for unit, value in UNITS.items():
        if size >= value:
            return f"{size / value:.1f} {unit}"
    return f"{size} B"

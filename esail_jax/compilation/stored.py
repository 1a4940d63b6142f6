"""The program cache: the folder in which compiled programs are kept from one process to the next.

The folder is `programs` in the user's cache folder, or what the environment variable `ESAIL_CACHE` names;
`ESAIL_CACHE=off` switches the cache off."""

from kept_programs.store import Store

STORE = Store("esail_jax/programs", "ESAIL_CACHE", b"esail_jax program\n", most_bytes=2**30)
"""At most 1 GiB, some hundred scenes. Programs used longest ago are removed."""

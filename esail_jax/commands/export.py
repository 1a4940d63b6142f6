"""`esail export`."""

from pathlib import Path

from esail_jax.atomic_file import atomic_file
from esail_jax.files.export import check_netcdf, write_csv, write_netcdf


def export_run(run: Path, output: Path) -> None:
    """Writes the observables of a run file to a file of another format and prints its path. Raises
    InputError."""
    write = write_csv
    if output.suffix.lower() == ".nc":
        check_netcdf()
        write = write_netcdf
    with atomic_file(output) as part:
        write(run, part)
    print(output)

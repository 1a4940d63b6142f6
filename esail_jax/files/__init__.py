"""Files: run files (`run_file.py`) and what all HDF5 files of the package share (`hdf5.py`)."""

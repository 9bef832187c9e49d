"""Writes the values of a field of a dataset of a file of `proofmass replay` as raw doubles."""
import sys

import h5py

with h5py.File(sys.argv[1], "r") as file:
    sys.stdout.buffer.write(file[sys.argv[2]][sys.argv[3]].astype("<f8").tobytes())

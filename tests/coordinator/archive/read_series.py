"""Writes each field of each dataset of a file of `proofmass replay` as raw doubles: DIRECTORY/a_c13.modes.time."""
import sys
from pathlib import Path

import h5py


def write(name, item):
    for field in item.dtype.names if isinstance(item, h5py.Dataset) else ():
        raw = item[field].astype("<f8").tobytes()
        Path(sys.argv[2], f"{name}.{field}".replace("/", ".")).write_bytes(raw)


with h5py.File(sys.argv[1], "r") as file:
    file.visititems(write)

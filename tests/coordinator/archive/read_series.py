"""Prints the attributes and datasets of a file of `proofmass replay` as JSON; with the name of a dataset and
of one of its fields, the values of that field as raw doubles."""
import json
import sys

import h5py
import numpy


def plain(value):
    if isinstance(value, str):
        return value
    if isinstance(value, numpy.ndarray):
        return [plain(entry) for entry in value]
    return value.item()


def description(file):
    answer = {"attributes": {name: plain(value) for name, value in file.attrs.items()}, "sessions": {}}
    for session, group in file.items():
        datasets = {
            name: {
                "fields": list(dataset.dtype.names),
                "types": sorted({str(dataset.dtype[field]) for field in dataset.dtype.names}),
                "shape": list(dataset.shape),
                **{key: plain(value) for key, value in dataset.attrs.items()},
            }
            for name, dataset in group.items()
        }
        attributes = {name: plain(value) for name, value in group.attrs.items()}
        answer["sessions"][session] = {"attributes": attributes, "datasets": datasets}
    return answer


with h5py.File(sys.argv[1], "r") as file:
    if len(sys.argv) == 2:
        print(json.dumps(description(file)))
    else:
        sys.stdout.buffer.write(file[sys.argv[2]][sys.argv[3]].astype("<f8").tobytes())

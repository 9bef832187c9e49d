"""Prints an export as JSON: attributes, columns, units, and doubles as the integers of their bits."""
import json
import sys

import h5py
import numpy

with h5py.File(sys.argv[1], "r") as file:
    names = {value: name for name, value in h5py.check_enum_dtype(file["status"].dtype).items()}
    answer = {
        "attributes": {
            name: value if isinstance(value, str) else int(value) for name, value in file.attrs.items()
        },
        "run_index": file["run_index"][:].tolist(),
        "num_draws": file["num_draws"][:].tolist(),
        "num_rounds": file["num_rounds"][:].tolist(),
        "status": [names[value] for value in file["status"][:]],
        "units": {},
        "bits": {},
    }
    for name in ("loss_cause", "loss_session"):
        names = {value: key for key, value in h5py.check_enum_dtype(file[name].dtype).items()}
        answer[name] = [names[value] for value in file[name][:]]
    for group in ("truth", "estimate", "error", "health", "draw"):
        if group not in file:
            continue
        for name, column in file[group].items():
            values = column[:]
            answer["units"][f"{group}/{name}"] = column.attrs["unit"]
            answer["bits"][f"{group}/{name}"] = [
                None if numpy.isnan(value) else int(value.view(numpy.uint64)) for value in values
            ]
print(json.dumps(answer))

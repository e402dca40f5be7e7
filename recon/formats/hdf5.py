"""A cloud as one HDF5 file: a dataset for each column, with its unit and meaning; the observations are in a group."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import canonical_json
from groundwork.errors import InputError
from groundwork.files import space_errors
from recon.cloud import (
    COLUMNS,
    FORMAT,
    FORMAT_VERSION,
    OBSERVATION_COLUMNS,
    OPTIONAL_COLUMNS,
    Cloud,
    ColumnKind,
    is_metric,
)

_LEVEL = 4  # deflate level: most of the possible compression at half the time


def write_hdf5(path: Path, cloud: Cloud) -> None:
    """Write HDF5, compressed without loss.

    Args:
        path: File to write, in a folder that the caller writes atomically.
        cloud: What to write.

    Raises:
        InputError: The package h5py is not installed.
    """
    try:
        import h5py
    except ModuleNotFoundError:
        raise InputError("the package h5py is not installed", where=path, hint="pip install falsework[hdf5]") from None
    with space_errors(path), h5py.File(path, "w", libver="latest") as file:
        file.attrs["format"], file.attrs["format_version"] = FORMAT, FORMAT_VERSION
        file.attrs["source"] = cloud.source
        file.attrs["classes"] = canonical_json([vars(row) for row in cloud.classes])
        file.attrs["components"] = canonical_json(list(cloud.components))
        kinds = {**COLUMNS, **OPTIONAL_COLUMNS}
        metric = is_metric(cloud.alignment)
        for name in sorted(cloud.columns):
            _put(file, name, cloud.columns[name], kinds[name], metric)
        group = file.create_group("observations", track_order=False)
        for name, values in sorted(cloud.observations.items()):
            _put(group, name, values, OBSERVATION_COLUMNS[name], metric)


def _put(group: Any, name: str, values: NDArray[Any], kind: ColumnKind, metric: bool) -> None:
    packed = {"compression": "gzip", "compression_opts": _LEVEL, "shuffle": True} if values.size else {}
    made = group.create_dataset(name, data=np.ascontiguousarray(values), track_times=False, **packed)
    made.attrs["unit"] = kind.unit if metric or kind.unit != "m" else "unknown"
    made.attrs["meaning"] = kind.meaning

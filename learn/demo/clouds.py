"""The clouds of the demonstration: some of our bridges, thinned, in one small file; reading and writing it."""

import io
import json
import lzma
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.files import write_bytes
from learn.datasets.settings import TileSettings
from learn.datasets.tiles import thin
from recon.cloud import COLUMNS, Cloud, read_cloud, without_observations, write_cloud
from usd_schemas.components import class_id, class_rows

FILE = "clouds.npz.xz"
STEP = 0.05  # [m] resolution of the stored positions: a tenth of the cubes of one point each
VOXEL = 0.5  # [m]


@dataclass(frozen=True, eq=False)
class DemoCloud:
    """A thinned cloud of one bridge.

    Attributes:
        name: Family and seed.
        bridge: Hash of its shape.
        coord: Positions from the middle of the cloud [m], shape (N, 3), float64, whole steps.
        kind: Row of `kinds`, shape (N,), uint8.
        kinds: Class of the base table and component kind of each.
    """

    name: str
    bridge: str
    coord: NDArray[np.float64]
    kind: NDArray[np.uint8]
    kinds: tuple[tuple[str, str], ...]


def thin_cloud(folder: Path, name: str) -> DemoCloud:
    """Thin a cloud of ours for the demonstration.

    Args:
        folder: A cloud.
        name: Name for people.
    """
    cloud = read_cloud(folder)
    names = {row.id: row.name for row in cloud.classes}
    pairs = cloud.columns["segment"].astype(np.int64) * len(cloud.components) + cloud.columns["component"]
    values, kind = np.unique(pairs, return_inverse=True)
    small = thin(cloud.columns["coord"], {"kind": kind.astype(np.uint8)}, TileSettings(voxel=VOXEL))
    middle = np.round(small.coord.mean(axis=0))
    kinds = tuple(
        (names[int(v) // len(cloud.components)], cloud.components[int(v) % len(cloud.components)]) for v in values
    )
    coord = np.rint((small.coord - middle) / STEP) * STEP
    return DemoCloud(name, cloud.bridge, coord, small.columns["kind"], kinds)


def pack_clouds(clouds: Sequence[DemoCloud], path: Path) -> None:
    """Write clouds into one file, as differences of neighbors along each axis, which compress well.

    Args:
        clouds: The clouds.
        path: File.
    """
    facts = [{"name": cloud.name, "bridge": cloud.bridge, "kinds": cloud.kinds} for cloud in clouds]
    arrays = {"facts": np.frombuffer(json.dumps(facts).encode(), np.uint8)}
    for number, cloud in enumerate(clouds):
        steps = np.rint(cloud.coord.T / STEP).astype(np.int16)
        arrays[f"coord{number}"] = np.diff(steps, axis=1, prepend=np.int16(0))
        arrays[f"kind{number}"] = cloud.kind
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays)  # not atomic: into memory
    write_bytes(path, lzma.compress(stream.getvalue(), preset=9 | lzma.PRESET_EXTREME))


def demo_clouds() -> list[DemoCloud]:
    """Read the clouds that come with the package."""
    packed = files("learn").joinpath("demo", FILE).read_bytes()
    with np.load(io.BytesIO(lzma.decompress(packed)), allow_pickle=False) as file:
        facts = json.loads(file["facts"].tobytes())
        return [
            DemoCloud(
                row["name"],
                row["bridge"],
                _places(file[f"coord{n}"]),
                file[f"kind{n}"],
                tuple(map(tuple, row["kinds"])),
            )
            for n, row in enumerate(facts)
        ]


def _places(steps: NDArray[np.int16]) -> NDArray[np.float64]:
    """Sum the differences along each axis."""
    return np.cumsum(steps, axis=1, dtype=np.int16).T.astype(np.float64) * STEP


def write_demo_cloud(cloud: DemoCloud, folder: Path) -> None:
    """Write a cloud as `falsework sample mesh` would, with the columns that the demonstration has.

    Args:
        cloud: The cloud.
        folder: Empty folder.
    """
    components = ("", *sorted({component for _, component in cloud.kinds} - {""}))
    segment = np.array([class_id(name) for name, _ in cloud.kinds], np.uint8)
    component = np.array([components.index(name) for _, name in cloud.kinds], np.uint16)
    count = len(cloud.coord)
    columns = {
        name: np.zeros((count, row.width) if row.width > 1 else count, row.dtype) for name, row in COLUMNS.items()
    }
    columns |= {"coord": cloud.coord, "segment": segment[cloud.kind], "component": component[cloud.kind]}
    write_cloud(
        folder, Cloud(columns, without_observations(count), components, class_rows(), {}, (), {}, "mesh", cloud.bridge)
    )

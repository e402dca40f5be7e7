"""Small scenes built by hand, so that the renderer is tested against geometry that is known in closed form."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from usd_schemas.components import class_rows
from usd_schemas.flat_scene import CameraTrack, Dome, Draws, FlatScene, Geometry, InstanceRow, Material, Product
from usd_schemas.pinhole import Pinhole, UsdLens, look_at

F64 = NDArray[np.float64]

CAMERA = Pinhole(160, 120, 140.0, 143.0, 81.3, 58.9)
DOWN = look_at(np.array([0.0, 0.0, 8.0]), np.array([0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
WHITE_DOME = Dome((1.0, 1.0, 1.0))


@dataclass
class SceneBuilder:
    """Collects shapes and hands out a `FlatScene`."""

    vertices: list[F64] = field(default_factory=list)
    normals: list[F64] = field(default_factory=list)
    st: list[F64] = field(default_factory=list)
    triangles: list[NDArray[np.int64]] = field(default_factory=list)
    rows: list[tuple[F64, int, int, int]] = field(default_factory=list)
    materials: list[Material] = field(default_factory=lambda: [Material("fallback")])

    def add_mesh(
        self, corners: F64, transform: F64, instance: int, label: int = 1, material: int = 0, st: F64 | None = None
    ) -> None:
        """Add triangles with flat normals.

        Args:
            corners: Mesh-local corners [m], shape (T, 3, 3), float64.
            transform: Mesh to world, shape (4, 4), float64.
            instance: Instance id.
            label: Class id.
            material: Row of the material.
            st: Texture coordinates per corner, shape (T, 3, 2), float64.
        """
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        self.vertices.append(corners.reshape(-1, 3))
        self.normals.append(np.repeat(normals, 3, axis=0))
        self.st.append((corners[..., :2] if st is None else st).reshape(-1, 2))
        self.triangles.append(np.arange(len(corners) * 3).reshape(-1, 3))
        self.rows.append((transform, material, instance, label))

    def add_box(self, transform: F64, instance: int, label: int = 1, material: int = 0) -> None:
        """Add a unit cube about its own origin.

        Args:
            transform: Cube to world, shape (4, 4), float64.
            instance: Instance id.
            label: Class id.
            material: Row of the material.
        """
        self.add_mesh(box_corners(), transform, instance, label, material)

    def build(self, poses: F64, camera: Pinhole = CAMERA) -> FlatScene:
        """Finish the scene.

        Args:
            poses: camera_to_world [m], shape (N, 4, 4), float64.
            camera: Intrinsics.
        """
        starts = np.cumsum([0, *(len(part) for part in self.vertices)])
        counts = np.array([len(part) for part in self.triangles], np.int32)
        vertices = np.concatenate(self.vertices)
        triangles = np.concatenate([part + start for part, start in zip(self.triangles, starts, strict=False)])
        geometry = Geometry(
            vertices.astype(np.float32),
            np.concatenate(self.normals).astype(np.float32),
            np.concatenate(self.st).astype(np.float32),
            np.zeros((len(vertices), 2), np.float32),
            np.ones((len(vertices), 3), np.float32),
            triangles.astype(np.uint32),
            (np.cumsum(counts) - counts).astype(np.int32),
            counts,
            np.ones(len(counts), np.uint8),
        )
        transforms, materials, ids, labels = zip(*self.rows, strict=True)
        draws = Draws(
            np.arange(len(counts), dtype=np.int32),
            np.array(transforms),
            np.array(materials, np.int32),
            np.array(ids, np.uint32),
            np.array(labels, np.uint8),
        )
        names = tuple(f"{row:06d}" for row in range(len(poses)))
        track = CameraTrack("test", "/Camera", UsdLens(0.24, 0.36, 0.27), poses, names, calibration=camera)
        known = sorted({(int(i), int(k)) for i, k in zip(ids, labels, strict=True)})
        rows = tuple(InstanceRow(i, f"/Part_{i}", "", class_rows()[k].name) for i, k in known)
        return FlatScene(
            geometry,
            draws,
            tuple(self.materials),
            None,
            None,
            (track,),
            (Product("test", 0, camera.width, camera.height),),
            rows,
            class_rows(),
            (),
            "test",
        )


def box_corners() -> F64:
    """List the triangles of a unit cube about the origin, shape (12, 3, 3), counter-clockwise from outside."""
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = np.roll(np.eye(3), 1, axis=0)[axis], np.roll(np.eye(3), 2, axis=0)[axis]
            normal = np.eye(3)[axis] * sign
            if np.dot(np.cross(u, v), normal) < 0:
                u, v = v, u
            quad = [(normal + a * u + b * v) / 2 for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            faces += [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    return np.array(faces)


def placed(
    position: tuple[float, float, float],
    size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    turn: float = 0.0,
) -> F64:
    """Make a transform: scale, then turn about z, then move.

    Args:
        position: Where the origin goes [m].
        size: Scale along x, y, z; negative mirrors.
        turn: Angle [rad].
    """
    transform = np.eye(4)
    cosine, sine = np.cos(turn), np.sin(turn)
    transform[:3, :3] = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]) @ np.diag(size)
    transform[:3, 3] = position
    return transform


def random_scene(seed: int, offset: F64, scale: float = 1.0, count: int = 40) -> FlatScene:
    """Scatter boxes, some mirrored, before three cameras.

    Args:
        seed: Seed.
        offset: Added to every world position [m], shape (3,), float64.
        scale: Size of the scene [1].
        count: Number of boxes.
    """
    rng = np.random.default_rng(seed)
    builder = SceneBuilder()
    for row in range(count):
        size = rng.uniform(0.3, 2.5, 3) * rng.choice([-1.0, 1.0], 3) * scale
        position = rng.uniform([-6, -6, -4], [6, 6, 4]) * scale + offset
        transform = placed((position[0], position[1], position[2]), (size[0], size[1], size[2]), rng.uniform(0, 6.3))
        builder.add_box(transform, row + 1, 1 + row % 15)
    eyes = [np.array([-14.0, 1.0, 2.0]), np.array([3.0, -12.0, 7.0]), np.array([0.0, 0.5, 15.0])]
    poses = [look_at(eye * scale + offset, offset.copy()) for eye in eyes]
    return builder.build(np.array(poses))


def with_materials(scene: FlatScene, materials: tuple[Material, ...]) -> FlatScene:
    """Return the scene with other materials.

    Args:
        scene: A scene.
        materials: Its new materials.
    """
    return replace(scene, materials=materials)

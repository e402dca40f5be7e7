"""The layers: what is authored composes to what was given, and looks fill roles without touching geometry."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSemantics, UsdShade

from authoring.layers.bridge import bridge_layer, payload_layer
from authoring.layers.geometry import BRIDGE, geometry_layer, roles_of
from authoring.layers.layer import export
from authoring.layers.looks import look_layer
from authoring.layers.semantics import semantics_layer
from authoring.layers.surveys import camera_path, survey_layer
from authoring.looks.material import MaterialRecipe
from authoring.shapes.component import Component, Mesh, Scatter
from authoring.surveys.camera_models import DEFAULT, calibration, camera_models
from authoring.surveys.gaze import aim
from authoring.surveys.path import CameraPath
from authoring.surveys.subject import piece_corners
from tests.authoring.boxes import box_bridge
from usd_schemas import tokens
from usd_schemas.apis import read_component, read_survey
from usd_schemas.pinhole import USD_FROM_CAMERA, UsdLens, pinhole_from_lens

PIECES = box_bridge()


@pytest.fixture(scope="module")
def bridge_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the bridge of boxes with a dark and a light look."""
    folder = tmp_path_factory.mktemp("bridge")
    export(geometry_layer(BRIDGE, PIECES), folder / "geometry.usdc")
    export(semantics_layer(BRIDGE, PIECES), folder / "semantics.usda")
    export(payload_layer(), folder / "payload.usda")
    for name, gray in (("dark", 0.2), ("light", 0.6)):
        recipes = {role: MaterialRecipe(role, color=(gray, gray, gray)) for role in roles_of(PIECES)}
        export(look_layer(recipes), folder / f"looks/{name}/look.usda")
    looks = {name: f"./looks/{name}/look.usda" for name in ("dark", "light")}
    export(bridge_layer("beam", (18.0, 22.0), 10.0, {}, looks), folder / "bridge.usda")
    return folder / "bridge.usda"


def test_geometry_comes_back(bridge_file: Path) -> None:
    """Points, faces, normals and both UV sets of every mesh read back as given, to the micrometer."""
    stage = Usd.Stage.Open(str(bridge_file))
    for piece in PIECES:
        if isinstance(piece, Component):
            mesh = UsdGeom.Mesh(stage.GetPrimAtPath(BRIDGE.prim(piece)))
            transform = np.array(mesh.ComputeLocalToWorldTransform(0)).T
            points = np.asarray(mesh.GetPointsAttr().Get()) @ transform[:3, :3].T + transform[:3, 3]
            np.testing.assert_allclose(points, piece.mesh.points, atol=2e-6)
            np.testing.assert_array_equal(mesh.GetFaceVertexIndicesAttr().Get(), piece.mesh.corners)
            np.testing.assert_allclose(mesh.GetNormalsAttr().Get(), piece.mesh.normals, atol=1e-6)
            st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
            assert st.IsIndexed()
            np.testing.assert_allclose(st.ComputeFlattened(), piece.mesh.st, atol=2e-6)
            assert mesh.GetSubdivisionSchemeAttr().Get() == UsdGeom.Tokens.none
            assert read_component(mesh.GetPrim()).parameters == piece.parameters


def test_instances_agree_with_the_ray_caster(bridge_file: Path) -> None:
    """The repeats of a PointInstancer stand where the surveys believe that they stand."""
    stage = Usd.Stage.Open(str(bridge_file))
    scatter = next(piece for piece in PIECES if isinstance(piece, Scatter))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath(BRIDGE.prim(scatter)))
    rows = np.array(instancer.ComputeInstanceTransformsAtTime(Usd.TimeCode.Default(), Usd.TimeCode.Default()))
    local = np.concatenate([mesh.points for _, mesh in scatter.prototypes[0]])
    stage_points = np.concatenate([local @ row[:3, :3] + row[3, :3] for row in rows])
    corners, ids = piece_corners((scatter,))
    assert sorted(set(ids.tolist())) == list(scatter.instance_ids)
    assert read_component(instancer.GetPrim()).instance_ids == scatter.instance_ids
    for bound in (np.min, np.max):
        expected = bound(corners.reshape(-1, 3), axis=0)
        np.testing.assert_allclose(bound(stage_points, axis=0), expected, atol=2e-3)  # half-float turns
        extent = bound(np.asarray(instancer.GetExtentAttr().Get()), axis=0)
        np.testing.assert_allclose(extent, expected, atol=2e-3)


def test_labels_stand_in_their_own_layer(bridge_file: Path) -> None:
    """Every leaf is labeled once, and muting the semantics layer takes the labels and nothing else."""
    stage = Usd.Stage.Open(str(bridge_file))
    cap = stage.GetPrimAtPath(f"{BRIDGE.group('Substructure')}/Pier_001_Cap")
    assert list(UsdSemantics.LabelsAPI(cap, "class").GetLabelsAttr().Get()) == ["pier_cap"]
    assert cap.GetAttribute(tokens.USER_INSTANCE_ID).Get() == 2
    layer = next(layer for layer in stage.GetUsedLayers() if layer.identifier.endswith("semantics.usda"))
    stage.MuteLayer(layer.identifier)
    assert not cap.GetAttribute(tokens.USER_CLASS)
    assert len(UsdGeom.Mesh(cap).GetPointsAttr().Get()) == 8


def test_look_fills_the_roles(bridge_file: Path) -> None:
    """Switching the variant changes the color that the same binding resolves to, there and back."""
    stage = Usd.Stage.Open(str(bridge_file))
    deck = stage.GetPrimAtPath(f"{BRIDGE.group('Superstructure')}/Deck_000")
    looks = stage.GetPrimAtPath("/Bridge").GetVariantSet("look")
    assert looks.GetVariantNames() == ["dark", "light"]
    seen = []
    for name in ("dark", "light", "dark"):
        looks.SetVariantSelection(name)
        material, _ = UsdShade.MaterialBindingAPI(deck).ComputeBoundMaterial()
        assert material.GetPath() == BRIDGE.material("Role_DeckConcrete")
        surface, _, _ = material.ComputeSurfaceSource("")
        seen.append(surface.GetInput("diffuseColor").Get()[0])
    np.testing.assert_allclose(seen, [0.2, 0.6, 0.2], atol=1e-6)


def test_nothing_heavy_is_read_without_the_payload(bridge_file: Path) -> None:
    """The interface shows looks and facts before geometry is loaded."""
    stage = Usd.Stage.Open(str(bridge_file), Usd.Stage.LoadNone)
    assert not stage.GetPrimAtPath(BRIDGE.geometry)
    assert stage.GetPrimAtPath("/Bridge").GetAttribute("falsework:bridge:family").Get() == "beam"
    assert not any(layer.identifier.endswith(".usdc") for layer in stage.GetUsedLayers())


def test_cameras_come_back(tmp_path: Path) -> None:
    """Poses, intrinsics, GPS and times of a survey read back; samples lie at 0 to N - 1."""
    rng = np.random.default_rng(3)
    positions = rng.normal(size=(9, 3)) * 20
    poses = aim(positions, rng.normal(size=(9, 3)))
    model = camera_models()[DEFAULT]
    camera = calibration(model, 960, 720)
    path = CameraPath(
        "flight",
        "global",
        7,
        camera,
        model.sensor_width,
        3.0,
        poses,
        np.arange(9.0),
        positions + 1,
        (0.5, 0.5, 0.8),
        rng.normal(size=(9, 3)),
        (1.0, 0.5, 0.5),
    )
    export(survey_layer(path), tmp_path / "flight.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "flight.usdc"))
    prim = UsdGeom.Camera(stage.GetPrimAtPath(camera_path("flight")))
    (operation,) = prim.GetOrderedXformOps()
    assert operation.GetTimeSamples() == [float(code) for code in range(9)]
    for code, pose in enumerate(poses):
        usd = np.array(prim.ComputeLocalToWorldTransform(code)).T
        np.testing.assert_allclose(usd @ np.linalg.inv(USD_FROM_CAMERA), pose, atol=2e-9)
    facts = read_survey(prim.GetPrim(), 9)
    assert facts.calibration == camera
    assert facts.gps is not None
    np.testing.assert_allclose(facts.gps, positions + 1, atol=5e-4)
    lens = UsdLens(
        prim.GetFocalLengthAttr().Get(), prim.GetHorizontalApertureAttr().Get(), prim.GetVerticalApertureAttr().Get()
    )
    assert lens.focal_length == pytest.approx(0.24)
    assert pinhole_from_lens(lens, 960, 720).fx == pytest.approx(640.0, rel=1e-6)


def test_equal_content_is_equal_bytes(tmp_path: Path) -> None:
    """Writing twice, and negative zeros in the input, give the same file."""
    piece = next(piece for piece in PIECES if isinstance(piece, Component))
    mesh = piece.mesh
    negative = Mesh(
        np.where(mesh.points == 0, -0.0, mesh.points),
        mesh.face_counts,
        mesh.corners,
        np.where(mesh.normals == 0, np.float32(-0.0), mesh.normals),
        mesh.st,
    )
    twin = Component(piece.name, piece.kind, piece.role, piece.group, negative, piece.instance_id)
    for name, one in (("a", piece), ("b", twin)):
        export(geometry_layer(BRIDGE, (one,)), tmp_path / f"{name}.usdc")
    assert (tmp_path / "a.usdc").read_bytes() == (tmp_path / "b.usdc").read_bytes()

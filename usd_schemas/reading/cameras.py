"""Reading of cameras with their poses, and of render products."""

import math
from dataclasses import astuple, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdRender

from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.apis import read_survey
from usd_schemas.flat_scene import CameraTrack, Product
from usd_schemas.pinhole import TENTH, USD_FROM_CAMERA, UsdLens, look_at
from usd_schemas.reading.choices import AS_AUTHORED, LARGEST_SIDE, MOST_FRAMES, StageChoices
from usd_schemas.reading.file_names import capture_name, distinct_names, image_names
from usd_schemas.reading.labels import Warn
from usd_schemas.reading.traversal import EARLIEST, composed_prims, guarded

F64 = NDArray[np.float64]

CAMERA_MODELS = ("SIMPLE_PINHOLE", "PINHOLE", "OPENCV")  # camera models of COLMAP allowed in the calibration schema
DEFAULT_WIDTH = 1280  # [px] where a stage states no resolution
FRAMING_HEIGHT = 960  # [px]
FRAMING_LENS = UsdLens(0.24, 0.36, 0.27)  # 24 mm on 36 x 27 mm
_WHOLE_WINDOW = (0.0, 0.0, 1.0, 1.0)
_SAME_ASPECT = 1e-3  # aspects with a smaller difference count as equal [1]
FRAMING_MARGIN = 0.9  # share of the picture that the scene may fill [1]
DEFAULT_NEAR = 0.1  # [m]
FARTHEST_NEAR = 1e6  # [m] larger values are taken as errors: such a camera would show nothing


def read_cameras(
    stage: Usd.Stage, stage_to_world: F64, warn: Warn, frames: tuple[float, ...] = ()
) -> tuple[CameraTrack, ...]:
    """Read every perspective camera.

    A survey's camera has one image for each integer time code at which it has samples, and so has any other camera that
    has samples at every frame from its first to its last. Any other camera that moves, by itself or with a parent, has
    one image for each whole frame of the stage between its first and last key; a camera that does not move has one.

    Args:
        stage: Composed stage.
        stage_to_world: Stage units to meters with z up [m per stage unit], shape (4, 4), float64.
        warn: Called with one line for each camera that is left out.
        frames: Time codes of every camera's images, instead of its own [time codes]; empty for its own.
    """
    tracks = []
    for prim in composed_prims(stage):
        if not prim.IsA(UsdGeom.Camera):
            continue
        with guarded(prim, warn, "the camera is left out"):
            track = _read_camera(UsdGeom.Camera(prim), stage_to_world, warn, frames)
            tracks += [track] if track is not None else []
    return tuple(tracks)


def _read_camera(
    camera: UsdGeom.Camera, stage_to_world: F64, warn: Warn, frames: tuple[float, ...]
) -> CameraTrack | None:
    """Read one camera; None, with a warning, if it is unusable."""
    path = camera.GetPath()
    if camera.GetProjectionAttr().Get(EARLIEST) != UsdGeom.Tokens.perspective:
        warn(f"{path}: only perspective cameras are rendered")
        return None
    lens = _read_lens(camera, warn)
    sizes = (lens.focal_length, lens.horizontal_aperture, lens.vertical_aperture)
    if not (min(sizes) > 0.0 and np.isfinite([*sizes, lens.horizontal_offset, lens.vertical_offset]).all()):
        warn(f"{path}: a lens without focal length or aperture")
        return None
    try:
        track = _read_track(camera, lens, stage_to_world, warn, frames)
    except InputError as error:
        warn(f"{path}: {error}: the camera is left out")
        return None
    if not np.isfinite(track.poses).all():
        warn(f"{path}: its poses are not finite")
        return None
    fault = _lens_fault(camera.GetPrim(), track)
    if fault:
        warn(f"{path}: {fault}")
    return None if fault else track


def image_codes(stage: Usd.Stage, track: CameraTrack, frames: tuple[float, ...] = ()) -> list[Usd.TimeCode]:
    """List the time codes of a camera's images.

    Args:
        stage: Composed stage.
        track: A camera of it; one without a prim has one image.
        frames: As for `read_cameras` [time codes].
    """
    if frames:
        return [Usd.TimeCode(frame) for frame in frames]
    prim = stage.GetPrimAtPath(track.path) if track.path else None
    if not prim:
        return [EARLIEST]
    survey = read_survey(prim, 0)
    return _codes(prim, bool(survey.kind or survey.image_names))


def _lens_fault(prim: Usd.Prim, track: CameraTrack) -> str:
    """Describe the error of a stated calibration; empty if it is valid."""
    stated = prim.GetAttribute("falsework:cal:model")
    model = str(stated.Get()) if stated and stated.HasAuthoredValue() else "PINHOLE"
    if model not in CAMERA_MODELS:
        return f"falsework:cal:model {model} is none of {', '.join(CAMERA_MODELS)}"
    camera = track.calibration
    if camera is None:
        return ""
    lens = (camera.fx, camera.fy, camera.cx, camera.cy, *astuple(track.distortion))
    if not (np.isfinite(lens).all() and min(camera.fx, camera.fy) > 0.0):
        return "falsework:cal has a focal length that is not positive, or a number that is not finite"
    if not 0 < min(camera.width, camera.height) <= max(camera.width, camera.height) <= LARGEST_SIDE:
        return f"falsework:cal:imageSize is {camera.width} x {camera.height}; allowed: 1 to {LARGEST_SIDE} px"
    if track.distortion.is_identity:
        return ""
    across, down = np.meshgrid(np.linspace(0, camera.width, 9), np.linspace(0, camera.height, 9))
    try:
        track.distortion.undistort(
            np.column_stack([(across.ravel() - camera.cx) / camera.fx, (down.ravel() - camera.cy) / camera.fy])
        )
    except InputError as error:
        return str(error)
    return ""


def _read_lens(camera: UsdGeom.Camera, warn: Warn) -> UsdLens:
    values = (
        camera.GetFocalLengthAttr(),
        camera.GetHorizontalApertureAttr(),
        camera.GetVerticalApertureAttr(),
        camera.GetHorizontalApertureOffsetAttr(),
        camera.GetVerticalApertureOffsetAttr(),
    )
    varying = ", ".join(
        value.GetName() for value in values if len({value.Get(at) for at in value.GetTimeSamples()}) > 1
    )
    if varying:
        warn(f"{camera.GetPath()}: {varying} changes with time: all images have one lens, the earliest")
    return UsdLens(*(float(told) if (told := value.Get(EARLIEST)) is not None else 0.0 for value in values))


def _read_track(
    camera: UsdGeom.Camera, lens: UsdLens, stage_to_world: F64, warn: Warn, frames: tuple[float, ...]
) -> CameraTrack:
    prim = camera.GetPrim()
    unit = float(np.linalg.norm(stage_to_world[:3, 0]))
    survey = read_survey(prim, 0)
    is_survey = bool(survey.kind or survey.image_names)
    codes = [Usd.TimeCode(frame) for frame in frames] or _codes(prim, is_survey)
    facts: dict[str, object] = {}
    if is_survey:
        facts = {"kind": survey.kind, "seed": survey.seed, "spacing": survey.spacing}
    times = _sampled(prim, "falsework:survey:captureTime", codes, warn)
    if times is not None:
        facts["capture_times"] = times.tolist()
    gps = _sampled(prim, "falsework:gps:localPosition", codes, warn)
    sensor = prim.GetAttribute("falsework:cal:sensorWidth")
    has_sensor = sensor and sensor.HasAuthoredValue()
    return CameraTrack(
        name=capture_name(prim, survey.id, warn),
        path=str(prim.GetPath()),
        lens=lens,
        poses=np.array([_pose(prim, code, stage_to_world) for code in codes]),
        image_names=image_names(prim, survey.image_names, len(codes), warn),
        calibration=survey.calibration,
        sensor_width=survey.sensor_width if has_sensor else lens.horizontal_aperture * TENTH * unit,
        near=_near(camera, unit, warn),
        gps=gps @ (stage_to_world[:3, :3] / unit).T if gps is not None else None,
        gps_sigma=survey.gps_sigma,
        facts=facts,
        distortion=survey.distortion,
        readout_time=survey.readout_time if math.isfinite(survey.readout_time) else 0.0,
        make=survey.camera_make,
        model=survey.camera_model,
        attitude=_sampled(prim, "falsework:gps:attitude", codes, warn),
        attitude_sigma=survey.attitude_sigma,
    )


def _near(camera: UsdGeom.Camera, unit: float, warn: Warn) -> float:
    """Read the near clipping distance [m]; the default if the stage has none or an invalid one."""
    told = camera.GetClippingRangeAttr().Get(EARLIEST)
    range_told = (0.0, 0.0) if told is None else (float(told[0]), float(told[1]))
    near, far = range_told[0] * unit, range_told[1] * unit
    if 0.0 < near < min(far, FARTHEST_NEAR):
        return near
    if near > 0.0 or not np.isfinite(near):
        warn(f"{camera.GetPath()}: its clippingRange {range_told} is unusable: drawn from {DEFAULT_NEAR:g} m on")
    return DEFAULT_NEAR


def _sampled(prim: Usd.Prim, name: str, codes: list[Usd.TimeCode], warn: Warn) -> F64 | None:
    """Read a time-sampled attribute at given codes; None if it has no samples, or some that are no numbers."""
    attribute = prim.GetAttribute(name)
    if not attribute or not attribute.GetNumTimeSamples():
        return None
    rows = np.array([attribute.Get(code) for code in codes], np.float64)
    if not np.isfinite(rows).all():
        warn(f"{prim.GetPath()}: {name} has values that are not finite: it is left out")
        return None
    return rows


def _codes(prim: Usd.Prim, is_survey: bool) -> list[Usd.TimeCode]:
    """List the time codes of a camera's images."""
    sampled: set[float] = set()
    above = prim
    while above and not above.IsPseudoRoot():
        if above.IsA(UsdGeom.Xformable):
            sampled |= set(UsdGeom.Xformable(above).GetTimeSamples())
            if UsdGeom.Xformable(above).GetResetXformStack():
                break
        above = above.GetParent()
    if len(sampled) < 2:
        return [Usd.TimeCode(value) for value in sampled] or [EARLIEST]
    whole = [Usd.TimeCode(value) for value in sorted(sampled) if value.is_integer()]
    every_frame = len(whole) == len(sampled) == max(sampled) - min(sampled) + 1
    if whole and (is_survey or every_frame):
        return whole
    stage = prim.GetStage()
    first, last = min(sampled), max(sampled)
    if stage.HasAuthoredTimeCodeRange():  # a camera does not move outside its keys
        start, end = max(first, stage.GetStartTimeCode()), min(last, stage.GetEndTimeCode())
        first, last = (start, end) if start <= end else (first, last)
    start, end = math.ceil(first), max(math.floor(last), math.ceil(first))
    if end - start >= MOST_FRAMES:
        hint = "Name those to render with --frame FIRST:LAST, or limit the stage's time codes"
        raise InputError(f"it moves for {end - start + 1:.9g} frames", allowed=f"{MOST_FRAMES:,}", hint=hint)
    return [Usd.TimeCode(value) for value in range(start, end + 1)]


def _pose(prim: Usd.Prim, code: Usd.TimeCode, stage_to_world: F64) -> F64:
    """Compute camera_to_world in meters, without the scale of its parents, shape (4, 4)."""
    matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(code)).T
    placed = stage_to_world @ matrix @ USD_FROM_CAMERA
    pose = np.eye(4)
    forward = placed[:3, 2] / np.linalg.norm(placed[:3, 2])
    down = placed[:3, 1] - forward * (placed[:3, 1] @ forward)
    down /= np.linalg.norm(down)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = np.cross(down, forward), down, forward, placed[:3, 3]
    return pose


def read_products(
    stage: Usd.Stage, cameras: tuple[CameraTrack, ...], warn: Warn, choices: StageChoices = AS_AUTHORED
) -> tuple[Product, ...]:
    """Read the render products; a stage without any gets one for each camera.

    Args:
        stage: Composed stage.
        cameras: Cameras that were read.
        warn: Called with one line for each product that is left out.
        choices: Which camera, and the size of its images.

    Raises:
        InputError: There is no such camera.
    """
    rows = {camera.path: row for row, camera in enumerate(cameras)}
    settings = UsdRender.Settings.GetStageRenderSettings(stage)
    targets = settings.GetProductsRel().GetForwardedTargets() if settings else []
    prims = [stage.GetPrimAtPath(path) for path in targets] or [
        prim for prim in composed_prims(stage) if prim.IsA(UsdRender.Product)
    ]
    products: dict[str, Product] = {}
    for prim in prims:
        if prim and prim.IsA(UsdRender.Product):
            with guarded(prim, warn):
                _add_product(prim, settings, rows, cameras, products, warn)
    found = _named(products, stage, warn) or _default_products(cameras)
    return tuple(sized(product, choices) for product in _of_camera(found, cameras, choices.camera))


def _of_camera(products: tuple[Product, ...], cameras: tuple[CameraTrack, ...], wanted: str) -> tuple[Product, ...]:
    """Keep the products of one camera, given by its name or path; if it has none, make one."""
    if not wanted:
        return products
    rows = [row for row, camera in enumerate(cameras) if wanted in (camera.name, camera.path)]
    rows = rows or [row for row, camera in enumerate(cameras) if wanted == camera.path.rpartition("/")[2]]
    if not rows:
        names = ", ".join(dict.fromkeys(camera.path or camera.name for camera in cameras))
        raise InputError("no such camera on the stage", field="--camera", value=wanted, allowed=names)
    kept = tuple(product for product in products if product.camera in rows)
    return kept or tuple(product for product in _default_products(cameras) if product.camera in rows)


def sized(product: Product, choices: StageChoices) -> Product:
    """Set the size of a product; if only one side is given, the aspect ratio is kept.

    Args:
        product: A product.
        choices: What the user chose.
    """
    width, height = choices.width, choices.height
    if not width and not height:
        return product
    width = width or max(1, round(product.width * height / product.height))
    return replace(product, width=width, height=height or max(1, round(product.height * width / product.width)))


def _add_product(
    prim: Usd.Prim,
    settings: UsdRender.Settings,
    rows: dict[str, int],
    cameras: tuple[CameraTrack, ...],
    products: dict[str, Product],
    warn: Warn,
) -> None:
    base = UsdRender.SettingsBase(prim)
    seen_by = base.GetCameraRel().GetForwardedTargets()
    if not seen_by and settings:
        seen_by = settings.GetCameraRel().GetForwardedTargets()
    row = rows.get(str(seen_by[0])) if seen_by else None
    if row is None:
        warn(f"{prim.GetPath()}: a RenderProduct without a camera")
        return
    resolution = base.GetResolutionAttr()
    if not resolution.HasAuthoredValue() and settings:
        resolution = settings.GetResolutionAttr()
    width, height = (int(value) for value in resolution.Get())
    if not 0 < min(width, height) <= max(width, height) <= LARGEST_SIDE:
        warn(f"{prim.GetPath()}: a RenderProduct of {width} x {height} pixels")
        return
    _note_unread(prim, settings, cameras[row].lens, width / height, warn)
    products[str(prim.GetPath())] = Product(cameras[row].name, row, width, height)


def _note_unread(prim: Usd.Prim, settings: UsdRender.Settings, lens: UsdLens, aspect: float, warn: Warn) -> None:
    """Report settings of a product that are not supported."""

    def told(name: str) -> Any:
        holders = [prim, settings.GetPrim()] if settings else [prim]
        attributes = [holder.GetAttribute(name) for holder in holders]
        found = next((one for one in attributes if one and one.HasAuthoredValue()), None)
        return found.Get(EARLIEST) if found else None

    policy, window, stretch = told("aspectRatioConformPolicy"), told("dataWindowNDC"), told("pixelAspectRatio")
    differs = abs(lens.horizontal_aperture / lens.vertical_aperture / aspect - 1.0) > _SAME_ASPECT
    if differs and policy not in (None, UsdRender.Tokens.expandAperture):
        warn(f"{prim.GetPath()}: aspectRatioConformPolicy {policy} is read as expandAperture")
    if window is not None and tuple(float(side) for side in window) != _WHOLE_WINDOW:
        warn(f"{prim.GetPath()}: dataWindowNDC is left out: the whole image is rendered")
    if stretch is not None and stretch != 1.0:
        warn(f"{prim.GetPath()}: pixelAspectRatio {stretch:g} is left out: pixels are square")
    targets = UsdRender.Product(prim).GetOrderedVarsRel().GetForwardedTargets()
    variables = [UsdRender.Var(prim.GetStage().GetPrimAtPath(target)) for target in targets]
    named = [str(variable.GetSourceNameAttr().Get(EARLIEST)) for variable in variables if variable]
    unknown = ", ".join(name for name in named if name not in tokens.RENDER_VAR_NAMES)
    if unknown:
        warn(f"{prim.GetPath()}: RenderVars {unknown} are not among {', '.join(tokens.RENDER_VAR_NAMES)}: not written")


def _named(products: dict[str, Product], stage: Usd.Stage, warn: Warn) -> tuple[Product, ...]:
    """Give products, by path, the names of their cameras; a second one of a name has its own name."""
    paths = list(products)
    wanted = [product.name for product in products.values()]
    names = distinct_names(wanted, lambda row: capture_name(stage.GetPrimAtPath(paths[row]), "", warn))
    return tuple(replace(product, name=name) for product, name in zip(products.values(), names, strict=True))


def _default_products(cameras: tuple[CameraTrack, ...]) -> tuple[Product, ...]:
    names = distinct_names([camera.name for camera in cameras], lambda row: cameras[row].name)
    return tuple(Product(name, row, *_default_size(cameras[row])) for row, name in enumerate(names))


def _default_size(camera: CameraTrack) -> tuple[int, int]:
    """Find the width and height of a camera's images without a product [px]."""
    if camera.calibration is not None:
        return camera.calibration.width, camera.calibration.height
    return DEFAULT_WIDTH, max(round(DEFAULT_WIDTH * camera.lens.vertical_aperture / camera.lens.horizontal_aperture), 1)


def framing_camera(low: F64, high: F64, images: int = 1) -> tuple[CameraTrack, Product]:
    """Make a camera that shows a whole box from above, from the south-west.

    Args:
        low: Lower corner [m], shape (3,), float64.
        high: Upper corner [m], shape (3,), float64.
        images: Number of its images.
    """
    center = (low + high) / 2
    pose = look_at(center + np.array([-1.0, -1.0, 0.7]), center)
    corners = np.array([[(low, high)[bit][axis] for axis, bit in enumerate(bits)] for bits in np.ndindex(2, 2, 2)])
    local = (corners - center) @ pose[:3, :3]
    lens = FRAMING_LENS
    half = np.array([lens.horizontal_aperture, lens.vertical_aperture]) / 2 / lens.focal_length * FRAMING_MARGIN
    distance = max(float(np.max(abs(local[:, :2]) / half - local[:, 2:])), 1e-3)
    pose[:3, 3] = center - distance * pose[:3, 2]
    near = min(DEFAULT_NEAR, distance / 100)
    names = tuple(f"{row:06d}" for row in range(images))
    track = CameraTrack("framing", "", lens, np.repeat(pose[None], images, axis=0), names, near=near)
    return track, Product("framing", 0, DEFAULT_WIDTH, FRAMING_HEIGHT)

"""A scene prepared for one survey: levels of detail, and the resolution of textures that its cameras need.

It depends only on the scene and the whole survey, so it is the same for every worker and view.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from groundwork.errors import InputError
from render.gpu.bars import Bars, find_bars
from render.gpu.gpu_scene import check_scene
from render.gpu.textures import TextureKey
from usd_schemas.flat_scene import CameraTrack, FlatScene, Geometry
from usd_schemas.pinhole import Pinhole, pinhole_from_lens


@dataclass(frozen=True)
class SurveyedScene:
    """A scene prepared for one survey.

    Attributes:
        scene: The scene, with this survey's product first.
        camera: Exact intrinsics of its images.
        needs: For each texture, the least width of a pixel in widths of the texture [1].
        bars: Members that may be thinner than a pixel.
    """

    scene: FlatScene
    camera: Pinhole
    needs: Mapping[TextureKey, float]
    bars: Bars

    @property
    def track(self) -> CameraTrack:
        """Camera and poses of the survey."""
        return self.scene.cameras[self.scene.products[0].camera]

    def without_meshes(self) -> "SurveyedScene":
        """Return the data that is needed after the meshes and draws are uploaded."""
        empty = {name: rows[:0].copy() for name, rows in vars(self.scene.geometry).items()}
        draws = self.scene.draws
        if not self.scene.moments:  # otherwise they are needed at each moment
            draws = replace(draws, transform=draws.transform[:0].copy())
        return replace(self, scene=replace(self.scene, geometry=Geometry(**empty), draws=draws))


def survey_scene(scene: FlatScene, triangle_budget: int) -> SurveyedScene:
    """Prepare a scene for the survey of its first product.

    Args:
        scene: A scene.
        triangle_budget: Largest number of triangles in view; 0: no limit.

    Raises:
        InputError: The scene has no product, nothing to draw, or numbers that cannot be drawn.
    """
    from render.detail.level_of_detail import (
        level_of_detail,  # imports scipy, whose memory drawing does not need
    )
    from render.detail.texel_need import survey_sight, texel_needs

    if not scene.products:
        raise InputError(
            "the stage has no RenderProduct", hint="Author a survey: a camera, and a product that names it"
        )
    check_scene(scene)
    product = scene.products[0]
    track = scene.cameras[product.camera]
    camera = product_camera(track, product.width, product.height)
    if scene.moments:  # moving objects may come close
        return SurveyedScene(scene, camera, {}, find_bars(scene))
    sight = survey_sight(track, camera)
    scene = level_of_detail(scene, track, camera, sight, triangle_budget)
    return SurveyedScene(scene, camera, texel_needs(scene, sight), find_bars(scene))


def product_camera(track: CameraTrack, width: int, height: int) -> Pinhole:
    """Find the exact intrinsics of a product: the stated calibration at its own size, else the lens.

    Args:
        track: A camera.
        width: Image width [px].
        height: Image height [px].
    """
    exact = track.calibration
    if exact is not None and (exact.width, exact.height) == (width, height):
        return exact
    return pinhole_from_lens(track.lens, width, height)

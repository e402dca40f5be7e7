"""What the renderer's tests share: an open context, and settings small enough for a test."""

from collections.abc import Iterator

import pytest

from render.gpu.context import Gl, open_context
from render.settings import RenderSettings, SensorSettings


@pytest.fixture
def gl() -> Iterator[Gl]:
    """Open a context for one test."""
    context = open_context()
    yield context
    context.close()


@pytest.fixture
def small() -> RenderSettings:
    """Everything on, nothing large."""
    return RenderSettings(shadow_size=512, volume_probes=1500, volume_rays=32, normals=True)


@pytest.fixture
def ideal(small: RenderSettings) -> RenderSettings:
    """No sensor flaws, lossless photographs, no haze worth mentioning."""
    sensor = SensorSettings(noise=False, image_format="png")
    return small.model_copy(update={"sensor": sensor, "haze_distance": 1e9})

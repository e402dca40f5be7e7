"""The band that a river leaves on the piers that stand in it."""

from dataclasses import replace

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.looks.weathering import weather
from authoring.shapes.component import Component
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from tests.authoring.boxes import box

HEIGHT, PIXELS, WATER = 8.0, 512, 2.0  # of the wall [m]; of its atlas [px]; of the river's surface [m]


def wall() -> Component:
    """A wall pier of which one side is the whole atlas, its foot at the first row."""
    mesh = box((0, 0, 0), (HEIGHT, 1, HEIGHT))
    front = np.flatnonzero(mesh.normals[:, 1] < -0.9)
    st1 = np.zeros((len(mesh.corners), 2), np.float32)
    st1[front] = mesh.points[mesh.corners][front][:, [0, 2]] / HEIGHT
    return Component("Pier", "wall_pier", "Role_PierConcrete", "Substructure", replace(mesh, st1=st1), 1)


@pytest.mark.parametrize("age", [0.1, 1.0])
def test_a_river_leaves_algae_and_silt_above_its_surface(age: float) -> None:
    """Algae up to 0.2 m, silt up to its high water, above that no change; the mean of the role stays 1."""
    dry, wet = (weather((wall(),), PIXELS, age, np.random.default_rng(3), level) for level in (None, WATER))
    assert wet.mean() == pytest.approx(1.0, abs=0.002)
    changed = np.median(wet / dry, axis=(1, 2))
    height = (np.arange(PIXELS) + 0.5) / PIXELS * HEIGHT
    height = height if changed[:64].mean() < changed[-64:].mean() else height[::-1]

    def at(low: float, high: float) -> float:
        return float(np.median(changed[(height > WATER + low) & (height < WATER + high)]))

    assert at(-0.2, 0.15) < 0.75 * at(2.0, 5.0)
    assert at(0.5, 0.6) < 0.95 * at(2.0, 5.0)
    assert changed[height > WATER + 1.6].std() < 1e-3
    assert changed[height < WATER - 0.9].std() < 1e-3
    assert at(2.0, 5.0) < 1.10  # the mean is kept, and a sixth of this wall is darker
    none = weather((wall(),), PIXELS, age, np.random.default_rng(3))
    np.testing.assert_array_equal(dry, none)


def test_only_piers_in_a_river_have_one() -> None:
    """The site tells the height of the water where a pier stands in it, and nothing elsewhere."""
    layout = Layout(Alignment(8.0), (0.0, 20.0, 40.0, 60.0), 10.0, 1.5, river_piers=True)
    asked = {"crossing": "river", "fine_spacing": 2.0}
    wet, dry = (
        draw_site(SiteSettings.model_validate({**asked, "river_piers": piers}), layout, stream(5, "site"))
        for piers in (True, False)
    )
    assert wet.land.crossing.piers
    assert wet.waterline == wet.land.crossing.level
    assert dry.waterline is None

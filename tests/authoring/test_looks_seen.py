"""What SIFT and the eye find on the looks: enough on old surfaces, little on new ones, nothing that repeats."""

from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import fft

from authoring.exchange.bake_stains import detail_factors
from authoring.looks.bake import LookSettings, bake_look, bake_surface
from authoring.looks.charts import draw_charts
from authoring.looks.encode import encode_raw
from authoring.looks.library import SheetName
from authoring.looks.material import MaterialRecipe
from authoring.looks.members import draw_fields, read_members, read_spots
from authoring.looks.roles import fill_roles
from authoring.looks.weathering import weather
from authoring.shapes.component import Component
from groundwork.canonical import file_digest
from tests.authoring.boxes import box
from tests.authoring.seen_surfaces import contrast, flat_material, keypoints, photograph, plates, right_matches
from tests.conftest import RecordProof

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

_DISTANCES = (0.5, 1.0, 2.0, 5.0, 15.0)  # [m]
_FAR = 1.0  # [m] from here on concrete has the contrast that photographs of concrete have, 6 to 12 %, and little more
_SLANTS = (0.0, 60.0)  # [deg]
_POOR = ("painted_steel_clean", "smooth_concrete_clean", "panel_concrete_clean")
_SIDE, _PIXEL = 30.0, 0.03  # [m]


def _surfaces() -> list[str]:
    rng = np.random.default_rng(0)
    return sorted({surface for look in ("weathered", "aged") for surface in fill_roles(look, rng)[0].values()})


@pytest.mark.proof_only
def test_old_surfaces_feed_sift(tmp_path: Path, record_proof: RecordProof) -> None:
    """Every role of `weathered` and `aged`, square and at 60 degrees, from near and far; new ones stay poor."""
    names = _surfaces()
    recipes = [bake_surface(SheetName(name, 0, 2048), tmp_path) for name in (*names, *_POOR)]
    rows = []
    poor = []
    with plates([flat_material(tmp_path, recipe) for recipe in recipes]) as prepared:
        for row, name in enumerate((*names, *_POOR)):
            for slant in _SLANTS:
                for distance in _DISTANCES:
                    one = photograph(prepared, row, distance, slant)
                    if name in _POOR:
                        poor.append(keypoints(one))
                        continue
                    other = photograph(prepared, row, distance, slant, 0.1 * distance)
                    rows.append((contrast(one), keypoints(one), right_matches(one, other), name, distance, slant))
    # The faintest is asphalt square from 0.5 m, where few of its stones are in the picture; the strongest is rubber.
    assert min(rows)[0] >= 0.035, min(rows)
    assert max(rows)[0] <= 0.17, max(rows)
    concrete = [row for row in rows if "concrete" in row[3] and row[4] >= _FAR]
    assert 0.06 <= min(concrete)[0] <= max(concrete)[0] <= 0.14, (min(concrete), max(concrete))
    fewest = min(rows, key=lambda found: found[1])
    assert fewest[1] >= 400, fewest
    worst = min(rows, key=lambda found: found[2])
    assert worst[2] >= 0.75, worst
    assert 10 * np.mean(poor) <= np.mean([found[1] for found in rows])
    record_proof(
        "looks/weathered and aged surfaces feed SIFT",
        len(rows),
        0,
        {
            "least_contrast": round(min(rows)[0], 3),
            "most_contrast": round(max(rows)[0], 3),
            "least_contrast_of_concrete_from_1_m": round(min(concrete)[0], 3),
            "most_contrast_of_concrete_from_1_m": round(max(concrete)[0], 3),
            "fewest_keypoints_per_megapixel": round(fewest[1]),
            "least_right_share": round(worst[2], 3),
            "clean_keypoints_per_megapixel": round(float(np.mean(poor))),
            "old_keypoints_per_megapixel": round(float(np.mean([found[1] for found in rows]))),
        },
    )


def _wall(role: str, side: float = _SIDE) -> Component:
    """A wall of 30 x 30 m, or another side, whose one chart is the whole atlas."""
    mesh = box((0, 0, 0), (side, 1, side))
    front = np.flatnonzero(mesh.normals[:, 1] < -0.9)
    place = mesh.points[mesh.corners][:, [0, 2]] / side
    st1 = np.full((len(mesh.corners), 2), 0.0, np.float32)
    st1[front] = place[front]
    return Component("Wall", "abutment_wall", role, "Superstructure", replace(mesh, st1=st1), 1)


def _look_up(image: F32, meters: float) -> F32:
    """An orthographic view of 30 x 30 m of a tiled picture, 3 cm a pixel, averaged over each."""
    count = max(4, round(meters / _PIXEL))
    small = cv2.resize(image, (count, count), interpolation=cv2.INTER_AREA)
    steps = (np.arange(round(_SIDE / _PIXEL), dtype=np.float32) * _PIXEL) / meters * count % count - 0.5
    u, v = np.meshgrid(steps, steps)
    return np.asarray(cv2.remap(small, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP), np.float32)


def orthophoto(folder: Path, recipe: MaterialRecipe, macro: U8 | None = None) -> F32:
    """Sheet and detail of a surface, 30 x 30 m of it, with the stains of a macro texture of that size."""
    coded = cv2.imread(str(folder / recipe.albedo_file), cv2.IMREAD_GRAYSCALE)
    gray = cv2.imread(str(folder / recipe.detail_file), cv2.IMREAD_GRAYSCALE)
    assert coded is not None
    assert gray is not None
    shown = _look_up(((coded / 255.0) ** 2.2).astype(np.float32), recipe.sheet)
    octaves = [
        np.float32(amplitude) * (2 * _look_up((gray / 255.0).astype(np.float32), period).reshape(-1, 1) - 1)
        for period, amplitude in zip(recipe.periods, recipe.amplitudes, strict=True)
    ]
    factors = detail_factors(octaves, None if macro is None else partial(_stain, macro))
    return shown * factors.mean(axis=1, dtype=np.float32).reshape(shown.shape)


def _stain(macro: U8, shift: F32) -> F32:
    """Look up a macro texture of 30 x 30 m at every pixel of an orthophoto, shifted by shares of its width."""
    count = len(macro)
    place = ((np.arange(round(_SIDE / _PIXEL)) + 0.5) * _PIXEL / _SIDE * count - 0.5).astype(np.float32)
    u, v = (grid.reshape(-1, 1) + shift[:, k : k + 1] * count for k, grid in enumerate(np.meshgrid(place, place)))
    found = np.zeros((len(u), 3), np.float32)
    for part in (slice(first, first + 30_000) for first in range(0, len(u), 30_000)):
        texels = cv2.remap(macro, u[part], v[part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        found[part] = texels.reshape(-1, 3).astype(np.float32) / 255
    return found


def _overlaps(level: F32) -> F32:
    """Sums of products of a picture with itself, for every shift."""
    size = (2 * len(level), 2 * len(level))
    spectrum = np.asarray(fft.rfft2(level, size))
    return np.asarray(fft.irfft2(np.abs(spectrum) ** 2), np.float32)


@cache
def _pairs(side: int) -> F32:
    """Number of pixels that lie on one another, for every shift."""
    return _overlaps(np.ones((side, side), np.float32))


def _blurred(shown: F32, meters: float) -> F32:
    """A Gaussian blur of so much standard deviation over a picture that is mirrored at its edges.

    The cosines of a picture are those of its blur but for a factor, which takes a tenth of the time of a wide kernel.
    """
    count = len(shown)
    kept = np.exp(-0.5 * (np.pi * meters / _PIXEL / count * np.arange(count, dtype=np.float32)) ** 2)
    return np.asarray(fft.idctn(fft.dctn(shown) * kept[:, None] * kept), np.float32)


def peak(shown: F32) -> float:
    """Highest autocorrelation beyond 1 m, of what is smaller than 8 m: slow changes of tone are no repetition."""
    level = shown / _blurred(shown, 4.0)
    level = level - level.mean()
    size = (2 * len(level), 2 * len(level))
    power, pairs = _overlaps(level), _pairs(len(level))
    shared = pairs > 0.25 * pairs.max()
    found = np.where(shared, power / np.maximum(pairs, 1), -1.0) / (power[0, 0] / pairs[0, 0])
    lag = np.minimum(np.arange(size[0]), size[0] - np.arange(size[0])) * _PIXEL
    return float(found[np.hypot(lag[:, None], lag[None, :]) > 1.0].max())


def broad_contrast(shown: F32) -> float:
    """RMS contrast of what is 0.5 to 15 m large [1]."""
    fine, broad = (_blurred(shown, meters / 4) for meters in (0.5, 15.0))
    return float(np.asarray(fine - broad, np.float64).std() / shown.mean())


@pytest.mark.proof_only
@pytest.mark.parametrize("role", ["Role_DeckConcrete", "Role_PierConcrete", "Role_DeckAsphalt", "Role_GirderSteel"])
def test_nothing_repeats_over_thirty_meters(tmp_path: Path, role: str, record_proof: RecordProof) -> None:
    """Sheet, grain and weather together: no autocorrelation over 0.25 beyond 1 m, and the contrast of real concrete.

    What is 0.5 to 15 m large on a wall of concrete has an RMS contrast of 6 to 12 %, and more where it is older.
    """
    wall = _wall(role)
    peaks, broad = {}, {}
    for look, years in (("weathered", 1.0), ("aged", 1.6)):
        surface = fill_roles(look, np.random.default_rng(0))[0][role]
        recipe = bake_surface(SheetName(surface, 0, 2048), tmp_path)
        alone = peak(orthophoto(tmp_path, recipe))
        macro = encode_raw(weather((wall,), 1024, years, np.random.default_rng(2)) / 2)
        stained = orthophoto(tmp_path, recipe, macro)
        peaks[look] = peak(stained)
        if "Concrete" in role:
            broad[look] = broad_contrast(stained)
            assert 0.06 <= broad[look] <= 0.12, (surface, broad[look])
        assert peaks[look] <= 0.25, (surface, peaks[look])
        assert peaks[look] < alone
    assert not broad or broad["weathered"] < broad["aged"]
    figures = {**peaks, **{f"broad_contrast_{look}": value for look, value in broad.items()}}
    record_proof(f"looks/nothing repeats over 30 m: {role}", 2, 2, {k: round(v, 3) for k, v in figures.items()})


def test_edges_of_stains_are_as_sharp_as_the_grain(tmp_path: Path, record_proof: RecordProof) -> None:
    """Stains with edges of 15 cm in the macro texture are three times as steep from 2 m, and their mean is the same.

    Its slope is measured against that of the texture alone, 2.4 mm a pixel; without grain it is as painted.
    """
    pixel, texel, count = 2 / 853, 0.049, 2048  # [m], a bridge of 100 m; texels of its atlas
    across, down = np.meshgrid((np.arange(800) + 0.5) * pixel, (np.arange(500) + 0.5) * pixel)
    recipe = bake_surface(SheetName("smooth_concrete", 0, 2048), tmp_path)
    coded = cv2.imread(str(tmp_path / recipe.detail_file), cv2.IMREAD_GRAYSCALE)
    assert coded is not None
    gray = (coded / 255).astype(np.float32)

    def octave(period: float, amplitude: float) -> F32:
        side = max(4, min(len(gray), round(period / pixel)))
        small = cv2.resize(gray, (side, side), interpolation=cv2.INTER_AREA)
        u, v = ((place / period % 1 * side - 0.5).astype(np.float32) for place in (across, down))
        found = cv2.remap(small, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP).reshape(-1, 1)
        return np.float32(amplitude) * (2 * np.asarray(found, np.float32) - 1)

    def macro(shift: F32) -> F32:
        away = np.abs((across.reshape(-1, 1) + shift[:, :1] * count * texel) % 0.5 - 0.25)  # stripes of 25 cm
        return np.repeat(0.5 - 0.25 * np.clip((away - 0.05) / 0.15, 0, 1), 3, axis=1).astype(np.float32)

    octaves = [octave(period, amplitude) for period, amplitude in zip(recipe.periods, recipe.amplitudes, strict=True)]
    drawn = detail_factors(octaves, macro) / detail_factors(octaves, None)
    painted = detail_factors([], macro)
    slopes = [np.abs(np.diff(one.mean(axis=1).reshape(across.shape), axis=1)).mean() for one in (drawn, painted)]
    assert slopes[0] > 3 * slopes[1]
    assert drawn.mean() == pytest.approx(painted.mean(), rel=0.02)
    facts = {"slope_of_texture_alone": 1.0, "slope": round(float(slopes[0] / slopes[1]), 1)}
    record_proof("looks/edges of stains are as sharp as the grain", 1, 0, facts)


def test_runs_have_no_upright_steps() -> None:
    """On a wall whose texels are a tenth of the noise's, what is streaked changes gradually, and swerves."""
    wall, pixels = _wall("Role_PierConcrete", 3.0), 1000
    charts = draw_charts([wall], pixels)
    rng = np.random.default_rng(2)
    members, fields = read_members([wall], 1.0, rng), draw_fields(rng)
    row, column = (grid.ravel() for grid in np.indices((pixels, pixels)))
    texels = charts.triangle[row, column], column, row
    spots = read_spots(charts, members, fields, texels, np.ones(len(row), np.float32))
    streaks, patches = (one.reshape(pixels, pixels) for one in (spots.streaks, spots.patches))
    even = np.abs(np.diff(patches, axis=1)) == 0  # the run is not bent between them
    steps = np.abs(np.diff(streaks, axis=1))
    assert even.mean() > 0.8
    assert steps[even].max() < 0.25 * np.ptp(streaks)
    assert (np.diff(streaks, axis=1)[even] != 0).mean() > 0.95


def test_what_has_no_chart_has_no_stain(monkeypatch: pytest.MonkeyPatch) -> None:
    """The corner of the atlas is neutral, as far as the renderer shifts the look-up of what has no chart."""
    monkeypatch.setattr("authoring.looks.weathering._FINE", 128)  # as in an atlas of 4096 texels
    factors = weather((_wall("Role_PierConcrete"),), 256, 1.0, np.random.default_rng(2))
    assert (np.roll(factors, (3, 3), axis=(0, 1))[:6, :6] == 1).all()
    assert (factors[0, 3:-3] != 1).any()


def test_a_scene_copies_its_sheets(tmp_path: Path, record_proof: RecordProof) -> None:
    """What a look has for itself is its macro texture; the rest are copies of the library's, in a second scene too."""
    parts = tuple(
        Component(f"Part_{n}", "column", role, "Substructure", box((3 * n, 0, 0), (3 * n + 1, 1, 6)), n + 1)
        for n, role in enumerate(("Role_PierConcrete", "Role_PierConcrete", "Role_GirderSteel"))
    )
    own = []
    for name in ("one", "two"):
        rng = np.random.default_rng(1)
        bake_look(LookSettings(texels=512), "weathered", tmp_path / name, parts, rng, library=tmp_path / "library")
        files = list((tmp_path / name / "textures").iterdir())
        kept = {file_digest(file) for file in (tmp_path / "library").glob("*/*")}
        own.append(sum(file.stat().st_size for file in files if file_digest(file) not in kept))
        assert sum(file_digest(file) in kept for file in files) >= 7
        assert all(file.stat().st_nlink == 1 for file in files)
    assert max(own) < 2e6
    record_proof("looks/bytes that a small scene does not share", 2, 1, {"most_megabytes": round(max(own) / 1e6, 2)})

"""What a user may choose about the reconstruction."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field

from groundwork.settings import Settings

Quality = Literal["low", "medium", "high", "ultra"]
Filter = Literal["none", "mild", "moderate", "aggressive"]

DOWNSCALE: Mapping[Quality, int] = {"low": 8, "medium": 4, "high": 2, "ultra": 1}
"""Pixels of the photograph along a side of a depth map's pixel."""
AGREEMENT: Mapping[Filter, tuple[int, float]] = {
    "none": (2, 0.02),
    "mild": (2, 0.01),
    "moderate": (3, 0.01),
    "aggressive": (5, 0.005),
}
"""Views that must agree on a dense point, and how far their depths may differ, as a share of the depth [1]."""
Mode = Literal["sparse", "dense"]
_LIMITS = frozenset(
    {
        "threads",
        "seconds_per_image",
        "memory_limit",
        "memory_per_image",
        "memory_per_megapixel",
    }
)
_OF_DENSE = frozenset({"quality", "filter"})
_OF_SPARSE = frozenset({"max_reprojection_error", "min_views", "sure_views", "max_deviation"})
LONGEST_SIDE = 3200
"""Longest side of the picture in which keypoints are sought; a larger photograph is reduced to it [px]."""


class SparseSettings(Settings):
    """Structure from motion: features, pairs, mapper, and the limits of its child processes."""

    peak_threshold: float = Field(default=0.004, ge=0.0005, le=0.05)
    """Contrast that a SIFT keypoint needs [1]; smooth concrete wants 0.002 to 0.004."""
    max_features: int = Field(default=8192, ge=256, le=65536)
    """Strongest keypoints kept of each image."""
    pairing: Literal["auto", "spatial", "sequential", "exhaustive"] = "auto"
    """Which images are matched; auto: spatial with GPS that tells images apart, else exhaustive for few images and
    sequential for many."""
    neighbours: int = Field(default=20, ge=2, le=200)
    """Nearest images by GPS that an image is matched with (spatial)."""
    leaps_from: int = Field(default=100, ge=3, le=1_000_000)
    """From this number of images on, every fourth is also matched with those 32, 64, 128 … further on (spatial)."""
    overlap: int = Field(default=10, ge=1, le=100)
    """Following images that an image is matched with, and as many 2, 4, 8 … further on (sequential)."""
    exhaustive_below: int = Field(default=40, ge=3, le=1000)
    """Up to this many images without GPS are matched exhaustively."""
    mapper: Literal["auto", "incremental", "global"] = "auto"
    """One image after the other, or all poses at once; auto: incremental below `global_from` images."""
    global_from: int = Field(default=400, ge=3, le=1_000_000)
    """From this number of images on, `auto` maps globally."""
    tie_points: int = Field(default=1000, ge=100, le=100_000)
    """Matched keypoints of an image that the mapper works with, about: half as many spread over the picture, and a
    hundred of each pair; all others become points afterwards."""
    use_gps_in_mapping: bool = False
    """Let the bundle adjustment pull camera centres towards their GPS positions; incremental mapper only."""
    two_view_tracks: bool = True
    """Make points that only two images saw; which of them stay in a sparse cloud, `max_deviation` says."""
    min_triangulation_angle: float = Field(default=1.5, ge=0.1, le=30.0)
    """Smallest angle between two rays of a point [deg]."""
    deterministic: bool = True
    """Map on one thread, so that the same images give the same bytes."""
    threads: int = Field(default=2, ge=1, le=256)
    """Threads of the extraction, processes of the matching, and threads of the mapper when not deterministic."""
    seconds_per_image: float = Field(default=60.0, ge=1.0, le=3600.0)
    """Wall time that each stage may take per image, on top of two minutes [s]; the keypoints of 8 megapixels and more
    take 20 s of a core."""
    memory_limit: float = Field(default=3.0, ge=0.5, le=1024.0)
    """Resident memory that a process may use, whatever the number of its images [GB]."""
    memory_per_image: float = Field(default=0.02, ge=0.0, le=1.0)
    """Resident memory that a process may use for each of its images, on top of that [GB]."""
    memory_per_megapixel: float = Field(default=0.35, ge=0.0, le=100.0)
    """Resident memory that the extraction may use per thread and megapixel of a photograph, reduced to a longest side
    of 3,200 px, on top of that [GB]."""


class DenseSettings(Settings):
    """Dense matching: how depth is measured, between which images, and the limits of its child process."""

    method: Literal["auto", "sgm", "patchmatch", "colmap"] = "auto"
    """How depth is measured; auto: COLMAP's PatchMatch where it has CUDA, else semi-global matching."""
    sources: int = Field(default=4, ge=1, le=16)
    """Images that each depth map is matched with, out of its `fusion_neighbours`; one that lies partly ahead counts for
    the part of it that can be compared."""
    fusion_neighbours: int = Field(default=10, ge=2, le=32)
    """Images whose depth maps each depth map is checked against."""
    min_angle: float = Field(default=2.5, ge=0.1, le=30.0)
    """Angle between two rays of a point below which an image is little help [deg]."""
    max_angle: float = Field(default=20.0, ge=2.0, le=60.0)
    """Angle between two rays of a point above which an image is little help [deg]."""
    min_point_angle: float = Field(default=1.5, ge=0.0, le=30.0)
    """Largest angle between the rays of a fused point below which it is dropped [deg]."""
    threads: int = Field(default=2, ge=1, le=256)
    """Depth maps measured, and truth images compared, at once; any number gives the same bytes."""
    seconds_per_image: float = Field(default=600.0, ge=1.0, le=7200.0)
    """Wall time that the dense step may take per image, on top of two minutes [s]; a photograph of 12 megapixels in
    `high` takes one to four minutes on two cores."""
    memory_limit: float = Field(default=2.0, ge=0.5, le=1024.0)
    """Resident memory that the dense step may use, however small the depth maps are [GB]."""
    memory_per_megapixel: float = Field(default=0.7, ge=0.0, le=100.0)
    """Resident memory that it may use per thread and megapixel of a depth map, on top of that [GB]."""


class AlignmentSettings(Settings):
    """The similarity from the reconstruction's frame to the world."""

    method: Literal["centres+rotations", "paper"] = "centres+rotations"
    """Take the rotation from the cameras' rotations, or everything from their centres alone (the paper)."""
    center_limit: float | None = Field(default=None, gt=0.0, le=100.0)
    """Distance above which a camera centre is an outlier [m]; left out: 0.25 for a local survey, else 0.5 % of the
    diagonal of the path and at most 0.5. Asked of captures with truth alone: no camera is judged by its GPS."""
    rotation_limit: float = Field(default=2.0, gt=0.0, le=20.0)
    """Angle above which a camera is an outlier [deg]; not used by `paper`."""
    iterations: int = Field(default=1000, ge=10, le=100_000)
    """Samples of three cameras that RANSAC tries; with truth."""
    max_invalid_share: float = Field(default=0.40, ge=0.0, le=1.0)
    """A scene with a greater share of unregistered and outlying cameras is rejected [1]."""


class ReconSettings(Settings):
    """From a capture to an annotated cloud."""

    mode: Literal["sparse", "dense", "both"] = "dense"
    """Which points: those of structure from motion, or one for nearly every pixel, which small parts need to be learnt
    from; both: a cloud of each, from one model."""
    quality: Quality = "medium"
    """Side of a depth map's pixel in pixels of the photograph: low 8, medium 4, high 2, ultra 1. `high` has four times
    the points of `medium`, for eight times the work."""
    filter: Filter = "moderate"
    """Views that must agree on a dense point, and how closely: none 2 within 2 %, mild 2 within 1 %, moderate 3 within
    1 %, aggressive 5 within 0.5 % of the depth."""
    sparse: SparseSettings = SparseSettings()
    """Structure from motion."""
    dense: DenseSettings = DenseSettings()
    """Dense matching."""
    alignment: AlignmentSettings = AlignmentSettings()
    """Alignment to the world."""
    max_reprojection_error: float = Field(default=2.0, gt=0.0, le=20.0)
    """Mean reprojection error above which a sparse point is dropped [px]."""
    min_views: int = Field(default=2, ge=2, le=20)
    """Valid cameras that must have seen a sparse point; for dense ones, see `filter`."""
    sure_views: int | None = Field(default=None, ge=2, le=10_000)
    """From this many valid cameras on, a sparse point stays whatever `max_deviation` says; left out: none does."""
    max_deviation: float = Field(default=0.1, ge=0.0, le=1000.0)
    """Standard deviation that the place of a sparse point may have along its worst direction [m]: told from its rays,
    and from how far its keypoints and those of all points miss. Not asked of photographs without a GPS that fits
    them: nothing tells metres there."""
    seed: int = Field(default=0, ge=0, lt=2**31)
    """Seed of every random draw in here."""

    @property
    def modes(self) -> tuple[Mode, ...]:
        """List the clouds to make, in this order."""
        return ("sparse", "dense") if self.mode == "both" else (self.mode,)

    def of_model(self) -> dict[str, Any]:
        """Return the settings that the model depends on, as JSON."""
        return {"seed": self.seed, "sparse": _without_limits(self.sparse)}

    def of_cloud(self, mode: Mode) -> dict[str, Any]:
        """Return the settings that a cloud depends on beside its model, as JSON.

        Args:
            mode: Which cloud.
        """
        other = _OF_DENSE if mode == "sparse" else _OF_SPARSE
        values = self.model_dump(mode="json", exclude={"mode", "sparse", "dense", *other})
        return {**values, "mode": mode, **({"dense": _without_limits(self.dense)} if mode == "dense" else {})}

    def limits(self) -> dict[str, Any]:
        """Return the limits of time and memory, which change no byte of a result, as JSON."""
        return {
            name: section.model_dump(mode="json", include=set(_LIMITS))
            for name, section in (("sparse", self.sparse), ("dense", self.dense))
        }


def _without_limits(section: SparseSettings | DenseSettings) -> dict[str, Any]:
    """Leave out settings that change no byte: threads count only for a mapper that is not deterministic."""
    bound = _LIMITS - {"threads"} if isinstance(section, SparseSettings) and not section.deterministic else _LIMITS
    return section.model_dump(mode="json", exclude=set(bound))

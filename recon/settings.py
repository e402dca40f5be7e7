"""Settings of the reconstruction."""

from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import Field, model_validator

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
    """Least contrast of a SIFT keypoint [1]; smooth concrete needs 0.002 to 0.004."""
    max_features: int = Field(default=8192, ge=256, le=65536)
    """Largest number of keypoints per image; the strongest are kept."""
    pairing: Literal["auto", "spatial", "sequential", "exhaustive"] = "auto"
    """Which images are matched with each other. auto: spatial, if GPS positions differ; else exhaustive for few images,
    sequential for many."""
    neighbours: int = Field(default=20, ge=2, le=200)
    """Number of nearest images by GPS that an image is matched with (spatial)."""
    leaps_from: int = Field(default=100, ge=3, le=1_000_000)
    """From this number of images on, every fourth image is also matched with those 32, 64, 128 … later (spatial)."""
    overlap: int = Field(default=10, ge=1, le=100)
    """Number of following images that an image is matched with, and as many 2, 4, 8 … later (sequential)."""
    exhaustive_below: int = Field(default=40, ge=3, le=1000)
    """Up to this many images without GPS are matched exhaustively."""
    mapper: Literal["auto", "incremental", "global"] = "auto"
    """incremental: one image after the other; global: all poses at once; auto: incremental below `global_from`
    images."""
    global_from: int = Field(default=400, ge=3, le=1_000_000)
    """From this number of images on, mapper `auto` is global."""
    tie_points: int = Field(default=1000, ge=100, le=100_000)
    """Approximate number of matched keypoints per image that the mapper uses: half of it spread over the image, and a
    hundred of each pair. The others become points afterwards."""
    use_gps_in_mapping: bool = False
    """Use GPS positions of the cameras in the bundle adjustment; only with the incremental mapper."""
    two_view_tracks: bool = True
    """Also make points that only two images saw; `max_deviation` decides which of them stay in a sparse cloud."""
    min_triangulation_angle: float = Field(default=1.5, ge=0.1, le=30.0)
    """Smallest angle between two rays of a point [deg]."""
    deterministic: bool = True
    """Run the mapper on one thread, so that the same images give the same bytes."""
    threads: int = Field(default=2, ge=1, le=256)
    """Number of threads of the extraction, processes of the matching, and threads of the mapper if not
    deterministic."""
    seconds_per_image: float = Field(default=60.0, ge=1.0, le=3600.0)
    """Largest wall time of each step per image, in addition to two minutes [s]. Keypoints of 8 megapixels or more take
    20 s on one core."""
    memory_limit: float = Field(default=3.0, ge=0.5, le=1024.0)
    """Largest resident memory of a process, independent of the number of images [GB]."""
    memory_per_image: float = Field(default=0.02, ge=0.0, le=1.0)
    """Additional resident memory of a process for each of its images [GB]."""
    memory_per_megapixel: float = Field(default=0.35, ge=0.0, le=100.0)
    """Additional resident memory of the extraction per thread and megapixel of a photograph, which is reduced to a
    longest side of 3,200 px [GB]."""

    @model_validator(mode="after")
    def _gps_is_used(self) -> Self:
        if self.use_gps_in_mapping and self.mapper == "global":
            raise ValueError(
                "use_gps_in_mapping has no effect with the mapper global; allowed: mapper incremental, or auto, which "
                "then is incremental"
            )
        return self


class DenseSettings(Settings):
    """Dense matching: how depth is measured, between which images, and the limits of its child process."""

    method: Literal["auto", "sgm", "patchmatch", "colmap"] = "auto"
    """How depth is measured. auto: colmap, if this COLMAP has CUDA, else sgm (semi-global matching)."""
    sources: int = Field(default=4, ge=1, le=16)
    """Number of images that each depth map is matched with, out of its `fusion_neighbours`; an image that is partly
    ahead counts as the part of it that can be compared."""
    fusion_neighbours: int = Field(default=10, ge=2, le=32)
    """Number of images with whose depth maps each depth map is compared."""
    min_angle: float = Field(default=2.5, ge=0.1, le=30.0)
    """Smallest useful angle between two rays of a point [deg]."""
    max_angle: float = Field(default=20.0, ge=2.0, le=60.0)
    """Largest useful angle between two rays of a point [deg]."""
    min_point_angle: float = Field(default=1.5, ge=0.0, le=30.0)
    """A fused point is dropped if the largest angle between its rays is smaller than this [deg]."""
    threads: int = Field(default=2, ge=1, le=256)
    """Number of depth maps measured, and truth images compared, at once; it does not change the result."""
    seconds_per_image: float = Field(default=600.0, ge=1.0, le=7200.0)
    """Largest wall time of the dense step per image, in addition to two minutes [s]. A photograph of 12 megapixels at
    quality `high` takes one to four minutes on two cores."""
    memory_limit: float = Field(default=2.0, ge=0.5, le=1024.0)
    """Largest resident memory of the dense step, independent of the size of the depth maps [GB]."""
    memory_per_megapixel: float = Field(default=0.7, ge=0.0, le=100.0)
    """Additional resident memory of the dense step per thread and megapixel of a depth map [GB]."""

    @model_validator(mode="after")
    def _angles_ascend(self) -> Self:
        if self.min_angle > self.max_angle:
            raise ValueError(
                f"min_angle ({self.min_angle:g} deg) is larger than max_angle ({self.max_angle:g} deg); allowed: the "
                "smaller one as min_angle"
            )
        return self


class AlignmentSettings(Settings):
    """The similarity from the reconstruction's frame to the world."""

    method: Literal["centres+rotations", "paper"] = "centres+rotations"
    """centers+rotations: the rotation comes from the cameras' rotations; paper: everything comes from their centers."""
    center_limit: float | None = Field(default=None, gt=0.0, le=100.0)
    """Distance above which a camera center is an outlier [m]; left out: 0.25 for a local survey, else 0.5 % of the
    diagonal of the path, at most 0.5. Only for captures with truth; GPS positions are not tested."""
    rotation_limit: float = Field(default=2.0, gt=0.0, le=20.0)
    """Angle above which a camera is an outlier [deg]; not used by `paper`."""
    iterations: int = Field(default=1000, ge=10, le=100_000)
    """Number of samples of three cameras that RANSAC tries; only for captures with truth."""
    max_invalid_share: float = Field(default=0.40, ge=0.0, le=1.0)
    """A scene with a larger share of unregistered cameras and outliers is rejected [1]."""


class ReconSettings(Settings):
    """From a capture to an annotated cloud."""

    mode: Literal["sparse", "dense", "both"] = "dense"
    """sparse: the points of structure from motion; dense: a point for nearly every pixel, which networks need to learn
    small parts; both: one cloud of each kind, from one model."""
    quality: Quality = "medium"
    """Side of a depth map's pixel in pixels of the photograph: low 8, medium 4, high 2, ultra 1. `high` has four times
    the points of `medium`, and needs eight times the work."""
    filter: Filter = "moderate"
    """How many views must agree on a dense point, and how closely. none: 2 within 2 % of the depth; mild: 2 within 1 %;
    moderate: 3 within 1 %; aggressive: 5 within 0.5 %."""
    sparse: SparseSettings = SparseSettings()
    """Structure from motion."""
    dense: DenseSettings = DenseSettings()
    """Dense matching."""
    alignment: AlignmentSettings = AlignmentSettings()
    """Alignment to the world."""
    max_reprojection_error: float = Field(default=2.0, gt=0.0, le=20.0)
    """Mean reprojection error above which a sparse point is dropped [px]."""
    min_views: int = Field(default=2, ge=2, le=20)
    """Number of valid cameras that must have seen a sparse point; for dense points, see `filter`."""
    sure_views: int | None = Field(default=None, ge=2, le=10_000)
    """A sparse point that this many valid cameras have seen stays, whatever its deviation; left out: no exception."""
    max_deviation: float = Field(default=0.1, ge=0.0, le=1000.0)
    """Largest standard deviation of the position of a sparse point in its worst direction [m], calculated from its rays
    and from the residuals of its keypoints and of all points. Not used for photographs without GPS that fits them,
    because their model has no scale."""
    seed: int = Field(default=0, ge=0, lt=2**31)
    """Seed of every random draw of the reconstruction."""

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

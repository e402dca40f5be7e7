"""Labels of reconstructed points: a vote of the true label images at the keypoints that the points were made from."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.points.observations import Observations
from recon.truth.label_margin import edge_distance
from recon.truth.noise_figures import THRESHOLD
from render.capture import Truth

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]


@dataclass(frozen=True)
class ObservedTruth:
    """The truth at each observation's pixel.

    Attributes:
        label: Class id, shape (M,), uint8.
        instance: Instance id, 0 for sky, shape (M,), uint32.
        depth: True planar depth [m], +inf for sky, shape (M,), float32.
        margin: Distance of the pixel's center to the next label edge [px], shape (M,), float32.
    """

    label: U8
    instance: U32
    depth: F32
    margin: F32


@dataclass(frozen=True)
class Annotation:
    """The labels of each point.

    Attributes:
        label: Class id, shape (N,), uint8.
        instance: Instance id, shape (N,), uint32.
        confidence: Share of the observations that show the class [1], shape (N,), float32.
        margin: Largest distance of an observation to a label edge [px], shape (N,), float32.
    """

    label: U8
    instance: U32
    confidence: F32
    margin: F32


def gather(truth: Truth, observations: Observations, threads: int = 1) -> ObservedTruth:
    """Look up the truth at each keypoint's pixel, one image at a time.

    The pixel is that of the detected keypoint, not of the reprojected point: the images and their truth have exactly
    the same pixels, whatever lens the reconstruction estimates.

    Args:
        truth: True label and depth images.
        observations: Keypoints.
        threads: How many images are read at a time.

    Returns:
        The truth at each observation.

    Raises:
        InputError: A truth image is missing, damaged, or of another size; names it.
    """
    count = len(observations.image)
    found = ObservedTruth(
        np.zeros(count, np.uint8), np.zeros(count, np.uint32), np.zeros(count, np.float32), np.zeros(count, np.float32)
    )
    height, width = truth.camera.height, truth.camera.width

    def read(image: int, rows: I64) -> None:
        pixel = np.floor(observations.uv[rows]).astype(np.int64)
        pixel = np.clip(pixel, 0, [width - 1, height - 1])  # a keypoint may lie exactly on the image's edge
        column, row = np.ascontiguousarray(pixel.T)
        labels, instances, depth = truth.semantic(image), truth.instance(image), truth.depth(image)
        found.label[rows] = labels[row, column]
        found.instance[rows], found.depth[rows] = instances[row, column], depth[row, column]
        found.margin[rows] = edge_distance(labels, row, column)

    observations.for_each_image(read, threads)
    return found


def annotate(observed: ObservedTruth, depth_error: F64, observations: Observations) -> Annotation:
    """Label each point by a vote of its observations: the class first, then the instance among those of that class.

    An observation votes if the surface that it shows lies within 0.1 m of the point in depth; if none does, the nearest
    one votes. The others see another surface: the sky behind a cable, or the rail in front of its sleeper. On a
    suspension bridge this corrects one wrong label in six.

    The class is decided first because a class may have many instances: three shrubs would outvote two views of one
    parapet, and the instance must belong to the chosen class. Of labels with equally many votes, the one with the
    smallest depth error is chosen, then the smaller number.

    Args:
        observed: Truth at the observations.
        depth_error: Depth error of each observation [m], shape (M,), float64; the smallest decides between equal votes.
        observations: Their points.

    Returns:
        The labels of each point.
    """
    depth_error = np.asarray(depth_error, np.float64)
    room = int(observations.counts.max(initial=0))
    return Annotation(
        *_verdicts(observations.start, observed.label, observed.instance, observed.margin, depth_error, room)
    )


@njit(cache=True, nogil=True)
def _verdicts(
    start: I64, label: U8, instance: U32, margin: F32, depth_error: F64, room: int
) -> tuple[U8, U32, F32, F32]:
    """Loops only: what NumPy does in one call takes Numba seconds to compile. `room`: most observations of a point."""
    count = len(start) - 1
    winner, part = np.empty(count, np.uint8), np.empty(count, np.uint32)
    share, clear = np.empty(count, np.float32), np.empty(count, np.float32)
    votes, errors, owner = np.empty(room, np.int64), np.empty(room), np.empty(room, np.int64)
    for point in range(count):
        first, end = start[point], start[point + 1]
        near, margins = depth_error[first], margin[first]
        for row in range(first + 1, end):
            near, margins = min(near, depth_error[row]), max(margins, margin[row])
        near = max(THRESHOLD, near)
        voting = 0
        for row in range(first, end):
            if depth_error[row] <= near:
                votes[voting], owner[voting], errors[voting] = label[row], instance[row], depth_error[row]
                voting += 1
        best = _most_frequent(votes[:voting], errors[:voting])
        agreeing = 0
        for vote in range(voting):
            if votes[vote] == best:
                owner[agreeing], errors[agreeing] = owner[vote], errors[vote]
                agreeing += 1
        winner[point], part[point] = best, _most_frequent(owner[:agreeing], errors[:agreeing])
        like = 0
        for row in range(first, end):
            like += label[row] == best
        share[point] = np.float32(like) / np.float32(end - first)
        clear[point] = margins
    return winner, part, share, clear


@njit(cache=True, nogil=True)
def _most_frequent(label: I64, depth_error: F64) -> np.int64:
    best, most, best_error = np.int64(0), 0, np.inf
    for first in range(len(label)):
        votes, least, counted = 0, np.inf, False
        for other in range(len(label)):
            if label[other] == label[first]:
                counted |= other < first
                votes, least = votes + 1, min(least, depth_error[other])
        if counted:
            continue
        closer = least < best_error or (least == best_error and label[first] < best)
        if votes > most or (votes == most and closer):
            best, most, best_error = label[first], votes, least
    return best

"""Labels of reconstructed points: what the true label images show at the keypoints that made them, put to the vote."""

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.noise_figures import THRESHOLD
from recon.observations import Observations
from render.capture import Truth

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]

_HALF_PIXEL = 0.5


@dataclass(frozen=True)
class ObservedTruth:
    """The truth at each observation's pixel.

    Attributes:
        label: Class id, shape (M,), uint8.
        instance: Instance id, 0 for sky, shape (M,), uint32.
        depth: True planar depth [m], +inf for sky, shape (M,), float32.
        margin: Distance of the pixel's centre to the next label edge [px], shape (M,), float32.
    """

    label: U8
    instance: U32
    depth: F32
    margin: F32


@dataclass(frozen=True)
class Annotation:
    """The verdict on each point.

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

    The pixel is that of the keypoint as it was found, not of the reprojected point: the images and their truth share
    pixels exactly, whatever the reconstruction thinks of its lens.

    Args:
        truth: True label and depth images.
        observations: Keypoints.
        threads: How many images are read at a time.

    Returns:
        What is there.

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
        column, row = np.clip(pixel, 0, [width - 1, height - 1]).T  # a keypoint may lie on the image's very edge
        labels, instances, depth = truth.semantic(image), truth.instance(image), truth.depth(image)
        for kind, values in (("semantic", labels), ("instance", instances), ("depth", depth)):
            if values.shape != (height, width):
                where = truth.folder / kind / truth.names[image]
                raise InputError("not the size of its photograph", where=where, value=values.shape,
                                 allowed=f"{height} rows, {width} columns", mend="Render the survey again")  # fmt: skip
        found.label[rows] = labels[row, column]
        found.instance[rows], found.depth[rows] = instances[row, column], depth[row, column]
        found.margin[rows] = edge_distance(labels)[row, column]

    observations.for_each_image(read, threads)
    return found


def edge_distance(labels: U8) -> F32:
    """Measure how far each pixel's centre lies from the next edge between labels.

    Args:
        labels: Class ids, shape (H, W), uint8.

    Returns:
        Distance [px], shape (H, W), float32: 0.5 beside an edge; the image's diagonal where there is no edge.
    """
    inner = np.ones(labels.shape, np.uint8)
    across, down = labels[:, 1:] != labels[:, :-1], labels[1:] != labels[:-1]
    inner[:, 1:][across] = inner[:, :-1][across] = 0
    inner[1:][down] = inner[:-1][down] = 0
    if inner.all():
        return np.full(labels.shape, np.hypot(*labels.shape), np.float32)
    return cv2.distanceTransform(inner, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) + np.float32(_HALF_PIXEL)


def annotate(observed: ObservedTruth, depth_error: F64, observations: Observations) -> Annotation:
    """Put labels to the vote: the class first, then the instance among the observations of that class.

    An observation votes when the surface that it shows lies within 0.1 m of the point in depth; for a point that none
    shows as near, the nearest does. The others look past the point: at the sky behind a cable, at the rail in front of
    its sleeper. On a suspension bridge that mends one wrong label in six.

    The class goes first because a class may be many instances: three shrubs outvote two views of one parapet, and
    the instance must belong to the class that won.

    Args:
        observed: Truth at the observations.
        depth_error: Depth error of each observation [m], shape (M,), float64; the smallest settles a tie.
        observations: Their points.

    Returns:
        The verdict on each point.
    """
    point, first = observations.point, observations.start[:-1]
    if not len(first):
        nothing = np.zeros(0, np.float32)
        return Annotation(np.zeros(0, np.uint8), np.zeros(0, np.uint32), nothing, nothing)
    voting = depth_error <= np.maximum(THRESHOLD, np.minimum.reduceat(depth_error, first))[point]
    label = vote(point[voting], observed.label[voting], depth_error[voting])
    agreeing = observed.label == label[point]
    voting &= agreeing
    return Annotation(
        label.astype(np.uint8),
        vote(point[voting], observed.instance[voting], depth_error[voting]).astype(np.uint32),
        (np.add.reduceat(agreeing, first, dtype=np.float32) / observations.counts).astype(np.float32),
        np.maximum.reduceat(observed.margin, first),
    )


def vote(point: I64, label: U8 | U32 | I64, depth_error: F64) -> I64:
    """Find the most frequent label of each point.

    Args:
        point: Point of each vote, ascending, shape (M,), int64, holding each number from 0 to N - 1.
        label: Label of each vote, shape (M,), an integer type.
        depth_error: Settles a tie: the label with the smallest one wins, then the smaller label, shape (M,), float64.

    Returns:
        Winning label, shape (N,), int64.
    """
    start = np.concatenate([[0], np.flatnonzero(np.diff(point)) + 1, [len(point)]]) if len(point) else np.zeros(1)
    return _vote(start.astype(np.int64), np.asarray(label, np.int64), np.asarray(depth_error, np.float64))


@njit(cache=True, nogil=True)
def _vote(start: I64, label: I64, depth_error: F64) -> I64:
    winner = np.empty(len(start) - 1, np.int64)
    for point in range(len(winner)):
        best, most, best_error = np.int64(0), 0, np.inf
        for first in range(start[point], start[point + 1]):
            votes, least, counted = 0, np.inf, False
            for other in range(start[point], start[point + 1]):
                if label[other] == label[first]:
                    counted |= other < first
                    votes, least = votes + 1, min(least, depth_error[other])
            if counted:
                continue
            closer = least < best_error or (least == best_error and label[first] < best)
            if votes > most or (votes == most and closer):
                best, most, best_error = label[first], votes, least
        winner[point] = best
    return winner

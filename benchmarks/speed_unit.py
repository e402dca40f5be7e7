"""How fast a machine is, in a unit of our own: processor seconds of two fixed tasks, one of NumPy, one of llvmpipe.

Usage: python -m benchmarks.speed_unit

Every page of a benchmark prints both beside its figures. A time that is to be held was set on the reference machine;
on another one it counts as many times as that one's task takes longer: a limit is a ratio, not a number of seconds.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

from falsework.platform import processor

ROOT = Path(__file__).resolve().parents[1]
Task = Literal["numpy", "llvmpipe"]
REFERENCE: dict[Task, float] = {"numpy": 0.070, "llvmpipe": 0.104}  # [s] where the limits of the pages were set
ROUNDS = 7  # the least of them counts: whatever else the machine does only adds
_SIDE, _TIMES = 384, 10
_PIXELS, _DRAWS = 512, 6

_VERTEX = """
#version 450
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }
"""
_FRAGMENT = """
#version 450
out vec4 color;
void main() {
    vec3 p = vec3(gl_FragCoord.xy * 0.01, 0.5);
    for (int i = 0; i < 48; i++) p = normalize(abs(p) / dot(p, p) - vec3(0.9, 0.6, 0.3)) + 0.1 * sin(p.zxy);
    color = vec4(p, 1.0);
}
"""


def numpy_task() -> None:
    """Multiply, transform, sort and select: what the chain asks of NumPy."""
    rng = np.random.default_rng(0)
    matrix = rng.random((_SIDE, _SIDE))
    for _ in range(_TIMES):
        matrix = matrix @ matrix
        matrix /= np.abs(matrix).max()
        spectrum = np.fft.rfft2(matrix)
        order = np.argsort(matrix, axis=None)
        matrix = np.fft.irfft2(spectrum) + matrix.ravel()[order].reshape(matrix.shape) * 0.5


def llvmpipe_task() -> Callable[[], None]:
    """Open Mesa's software driver, and give what draws a picture of arithmetic some times."""
    from render.gpu.context import open_context

    gl = open_context("software").context
    target = gl.framebuffer([gl.renderbuffer((_PIXELS, _PIXELS))])
    program = gl.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
    triangle = gl.vertex_array(program, [])

    def draw() -> None:
        target.use()
        for _ in range(_DRAWS):
            triangle.render(vertices=3)
        target.read()

    return draw


def least(task: Callable[[], None]) -> float:
    """Measure a task: the least processor time of some rounds, all threads together [s].

    Args:
        task: The task; a first round warms up.
    """
    task()
    times = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        task()
        times.append(time.process_time() - begin)
    return min(times)


@cache
def speed_unit() -> dict[Task, float]:
    """Measure both tasks once, in a process of its own with one thread for NumPy [s]."""
    alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "benchmarks.speed_unit"]
    done = subprocess.run(command, cwd=ROOT, env=alone, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def slower(task: Task) -> float:
    """Measure how many times longer a task takes here than on the reference machine [1].

    Args:
        task: Which.
    """
    return speed_unit()[task] / REFERENCE[task]


def this_machine() -> str:
    """Name the processor and its speed, for a page."""
    unit = speed_unit()
    return (
        f"{processor()} (our [speed unit](../../benchmarks/speed_unit.py): NumPy {unit['numpy']:.3f} s, "
        f"llvmpipe {unit['llvmpipe']:.3f} s)"
    )


if __name__ == "__main__":
    print(json.dumps({"numpy": least(numpy_task), "llvmpipe": least(llvmpipe_task())}))  # noqa: T201

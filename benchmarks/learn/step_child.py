"""One way of `benchmarks.learn.step` in a process of its own.

Usage: python -m benchmarks.learn.step_child NETWORK, or "NETWORK bf16" as one word.
"""

import json
import sys

from benchmarks.learn.step import our_steps

if __name__ == "__main__":
    name, _, kind = sys.argv[1].partition(" ")
    print(json.dumps(our_steps(name, 1, bf16=kind == "bf16")))  # noqa: T201

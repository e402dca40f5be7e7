"""One way of `benchmarks.learn` in a process of its own: `python -m benchmarks.learn_step NETWORK ["NETWORK bf16"]`."""

import json
import sys

from benchmarks.learn import our_steps

if __name__ == "__main__":
    name, _, kind = sys.argv[1].partition(" ")
    print(json.dumps(our_steps(name, 1, bf16=kind == "bf16")))  # noqa: T201

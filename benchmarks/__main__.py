"""Measure the chain on this machine and write the tables under `docs/benchmarks`.

Usage: python -m benchmarks
"""

from benchmarks.authoring import bridges, stage, surveys
from benchmarks.falsework import chain

if __name__ == "__main__":
    stage.main()
    bridges.main()
    surveys.main()
    chain.main()

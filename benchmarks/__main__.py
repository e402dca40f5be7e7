"""Measure the chain on this machine and write the tables under `docs/benchmarks`.

Usage: python -m benchmarks
"""

from benchmarks import chain, stage

if __name__ == "__main__":
    stage.main()
    chain.main()

"""Measure the chain on this machine and write the tables under `docs/benchmarks`.

Usage: python -m benchmarks
"""

from benchmarks import bridges, chain, stage

if __name__ == "__main__":
    stage.main()
    bridges.main()
    chain.main()

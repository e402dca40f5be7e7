"""Measure the chain on this machine and write the tables under `docs/benchmarks`.

Usage: python -m benchmarks
"""

from benchmarks import bridges, chain, stage, surveys

if __name__ == "__main__":
    stage.main()
    bridges.main()
    surveys.main()
    chain.main()

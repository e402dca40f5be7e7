"""Measure the chain on this machine and write the tables under `docs/benchmarks`.

Usage: python -m benchmarks
"""

from benchmarks import chain

if __name__ == "__main__":
    chain.main()

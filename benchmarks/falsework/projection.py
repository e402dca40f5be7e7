"""What the paper's two data sets cost on few and on many cores: `python -m benchmarks.falsework.projection`.

The processor time of a scene, from its seed to its annotated cloud, is that of the rows `paper-local` and
`paper-global` of docs/proof.json, which `make proof` measures. Scenes need nothing of each other: cores share
them evenly.
"""

from pathlib import Path
from statistics import fmean

from benchmarks.page import write_page
from falsework.platform import processor
from falsework.scenario import load_scenario
from groundwork.errors import InputError
from groundwork.files import read_json

ROOT = Path(__file__).resolve().parents[2]
PROOF = ROOT / "docs" / "proof.json"
PAGE = ROOT / "docs" / "benchmarks" / "projection.md"
SETS = ("paper-local", "paper-global")
CORES = (2, 64)
_MINUTE, _HOUR, _DAY = 60.0, 3600.0, 24.0  # [s], [s], [h]


def main() -> None:
    """Write the page."""
    rows = read_json(PROOF)["rows"]
    lines = [
        "# The paper's data sets, projected",
        "",
        "Written by `python -m benchmarks.falsework.projection` from the rows of [proof.json](../proof.json): "
        f"processor time from seed to annotated cloud, measured on {processor()}. Scenes are independent.",
        "",
        "| data set | scenes | scenes measured | images a scene | CPU-min a scene | least | most | "
        + " | ".join(f"{cores} cores [days]" for cores in CORES)
        + " |",
        "|---|" + "---|" * (6 + len(CORES)),
    ]
    for name in SETS:
        measured = [row["figures"] for row in rows if row["name"].startswith(f"{name}: ") and "cpu_s" in row["figures"]]
        if not measured:
            raise InputError("no scene has been measured", where=PROOF, field=name, hint="Run make proof")
        seconds = [figures["cpu_s"] for figures in measured]
        count = load_scenario(ROOT / "scenarios" / f"{name}.toml").scenes
        hours = count * fmean(seconds) / _HOUR
        days = " | ".join(f"{hours / cores / _DAY:.2f}" for cores in CORES)
        lines.append(
            f"| {name} | {count} | {len(measured)} | {fmean(figures['images'] for figures in measured):.0f} | "
            f"{fmean(seconds) / _MINUTE:.0f} | {min(seconds) / _MINUTE:.0f} | {max(seconds) / _MINUTE:.0f} | {days} |"
        )
    write_page(PAGE, "\n".join(lines) + "\n", __file__)


if __name__ == "__main__":
    main()

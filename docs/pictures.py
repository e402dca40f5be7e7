"""Every picture of docs/images with the command that makes it, and one command that makes those that are named.

Usage: python -m docs.pictures --list
       python -m docs.pictures NAME… [--with RUN=demo-out] [--dry-run]

NAME is a file below docs/images, such as `gallery/slab.jpg`, or a folder of it. What a command needs from its caller
(the folder of a run, a cloud, scans) stands in capitals in the list and is given with --with.
"""

import argparse
import difflib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

IMAGES = Path(__file__).resolve().parent / "images"
OUT = "OUT"  # in a command: a folder that is made for it, from which the pictures are taken
NEEDS = {
    "RUN": "folder of falsework demo -o RUN",
    "CLOUD": "a cloud of that run, RUN/scenes/0000/cloud/global",
    "SCAN": "tripod scan bare-049 of python -m benchmarks.shipped.clouds WORK --seed 50101 --bare 46:50",
    "OTHER": "tripod scan bare-046 of the same command",
    "FLIGHTS": "a scene with several flights: falsework author docs/gallery/flights.toml -o FLIGHTS",
    "RUNS": "a folder that keeps the runs of docs.hero_bridges; made where they are missing",
    "WORK": "a folder that keeps what Cycles drew",
    "SCANS": "folder with checkouts of the repositories that benchmarks/shipped/real_scans.py names",
    "WORLD": "a city: falsework background import CITY -o WORLD",
}
FAMILIES = ("arch", "beam", "cable_stayed", "girder", "slab", "suspension")
WORLDS = ("city", "countryside", "hillside", "lakeside")


@dataclass(frozen=True)
class Recipe:
    """How some pictures are made, all of them at once.

    Attributes:
        pictures: Files below docs/images.
        words: Words after `python -m`; those in capitals are given by the caller, `OUT` is a folder made for them.
        about: What else has to be there, in words; empty for nothing.
    """

    pictures: tuple[str, ...]
    words: tuple[str, ...]
    about: str = ""

    @property
    def needs(self) -> list[str]:
        """Words that the caller gives."""
        return [word for word in self.words if word in NEEDS]


def _gallery(folder: str, names: Sequence[str], *words: str) -> Recipe:
    """A recipe for sheets of `falsework gallery`, which are called alike in its folder and in ours."""
    return Recipe(tuple(f"{folder}/{name}.jpg" for name in names), ("falsework", "gallery", *words, "-o", OUT))


RECIPES = (
    Recipe(("architecture.svg",), ("docs.generate",)),
    Recipe(("hero.jpg",), ("docs.hero_picture", "RUNS")),
    Recipe(("chain.png",), ("docs.picture", "RUN")),
    Recipe(("dense_cloud.png",), ("docs.cloud_picture", "CLOUD")),
    Recipe(("sampling.png",), ("docs.sampling_picture", "RUN")),
    Recipe(("flights.png",), ("docs.flights_picture", "FLIGHTS")),
    Recipe(("prediction.png",), ("docs.prediction_picture", "SCAN", "OTHER"), "the extra learn"),
    Recipe(("real_scans.png",), ("benchmarks.shipped.real_scans", "SCANS"), "the extra learn; writes its page, too"),
    Recipe(("bench_scene.jpg",), ("benchmarks.render.speed",), "measures for its page, too: long"),
    Recipe(
        ("bench_light.jpg",),
        ("benchmarks.render.light", "WORK"),
        "FALSEWORK_BPY_PYTHON, as below; writes its page, too",
    ),
    *(_gallery("gallery", [name], "families", "--family", name, "--count", "3", "--seed", "11") for name in FAMILIES),
    *(_gallery("worlds", [name], "worlds", "--world", name, "--count", "4", "--seed", "0") for name in WORLDS),
    Recipe(("worlds/imported.jpg",), ("docs.imported_picture", "WORLD")),
    _gallery("looks", ["looks"], "looks", "--seed", "7"),
    Recipe(("looks/surfaces.jpg",), ("docs.surfaces_picture",)),
    _gallery("combinations", WORLDS, "combinations", "--seed", "7"),
    Recipe(
        tuple(
            f"blender/{name}.png" for name in ("1_authored", "2_exported", "3_edited", "4_labels", "5_clean", "6_town")
        ),
        ("tests.dcc.pictures",),
        "FALSEWORK_BPY_PYTHON=.venv-dcc/bin/python in the environment, after make .venv-dcc/.stamp",
    ),
)


def chosen(names: Sequence[str]) -> list[Recipe]:
    """Find the recipes of some pictures, each once, in the order of the list.

    Args:
        names: Files or folders below docs/images.

    Raises:
        SystemExit: No such picture; the nearest is named.
    """
    known = {picture: recipe for recipe in RECIPES for picture in recipe.pictures}
    found = list[Recipe]()
    for name in names:
        plain = name.removeprefix("docs/images/").rstrip("/")
        mine = [recipe for picture, recipe in known.items() if picture == plain or picture.startswith(f"{plain}/")]
        if not mine:
            near = difflib.get_close_matches(plain, known, n=1, cutoff=0.4)
            raise SystemExit(f"no such picture: {name}" + (f". Did you mean {near[0]!r}?" if near else ""))
        found += mine
    return [recipe for recipe in RECIPES if recipe in found]


def make(recipe: Recipe, given: dict[str, str]) -> None:
    """Run the command of a recipe, and take its pictures over where it does not write them into docs/images itself.

    Args:
        recipe: What to make.
        given: Word in capitals, and what to put for it.

    Raises:
        SystemExit: A word that was not given, or the command failed.
    """
    missing = [word for word in recipe.needs if word not in given]
    if missing:
        raise SystemExit("\n".join(f"{recipe.pictures[0]}: give --with {word}=…: {NEEDS[word]}" for word in missing))
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "out"
        words = [str(out) if word == OUT else given.get(word, word) for word in recipe.words]
        done = subprocess.run([sys.executable, "-m", *words], cwd=IMAGES.parents[1], check=False)
        if done.returncode:
            raise SystemExit(f"{' '.join(recipe.words)}: ended with {done.returncode}")
        if OUT in recipe.words:
            for picture in recipe.pictures:
                (IMAGES / picture).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(out / Path(picture).name, IMAGES / picture)


def lines(recipes: Sequence[Recipe]) -> list[str]:
    """List the recipes of pictures, and their requirements.

    Args:
        recipes: What to list.
    """
    told = []
    for recipe in recipes:
        told.append(", ".join(recipe.pictures))
        told.append(f"    python -m {' '.join(recipe.words)}")
        told += [f"    {word}: {NEEDS[word]}" for word in recipe.needs]
        told += [f"    needs {recipe.about}"] if recipe.about else []
    return told


def main(arguments: list[str]) -> int:
    """List the pictures, or make those that are named.

    Args:
        arguments: Words of the command line.

    Returns:
        Exit code.
    """
    parser = argparse.ArgumentParser(prog="python -m docs.pictures", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="files or folders below docs/images")
    parser.add_argument("--list", action="store_true", help="say what makes each picture, and make none")
    parser.add_argument("--dry-run", action="store_true", help="say which commands would run, and make none")
    parser.add_argument("--with", dest="given", action="append", default=[], metavar="WORD=PATH")
    asked = parser.parse_args(arguments)
    if not asked.names and not asked.list:
        parser.error("name pictures, or --list")
    recipes = chosen(asked.names) if asked.names else list(RECIPES)
    if asked.list or asked.dry_run:
        sys.stdout.write("\n".join(lines(recipes)) + "\n")
        return 0
    given = {word: path for word, _, path in (pair.partition("=") for pair in asked.given)}
    for recipe in recipes:
        make(recipe, given)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

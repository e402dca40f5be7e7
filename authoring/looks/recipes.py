"""The table of all surfaces: how each is drawn, how large its sheet is, and how strong its fine detail."""

from authoring.looks.recipe import Recipe
from authoring.looks.scenery import SCENERY
from authoring.looks.structural import STRUCTURAL

RECIPES: dict[str, Recipe] = {**STRUCTURAL, **SCENERY}

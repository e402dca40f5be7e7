"""Author a bridge, and swap its layers.

A bridge, its surroundings and its flights are one USD stage of several layers. This notebook makes one, gives it
another look, and shows what changes: only colors.
"""

# %% [markdown]
# ## One bridge in two looks
# A scenario says what is fixed. What it leaves out is drawn from the seed.

# %%
import falsework

scenario = {
    "seed": 7,
    "bridge": {"family": "beam", "service": "road", "beam": {"spans": [12.0]}},
    "background": {"name": "none"},
    "survey": [{"kind": "global", "images": 12, "width": 640, "height": 480}],
    "variants": {"look": ["weathered", "clean"]},
}
scene = falsework.author(scenario, "scene")

# %% [markdown]
# ## What lies in the folder
# `scene.usda` only lists the layers. Each layer holds one topic.

# %%
from pxr import Usd

stage = Usd.Stage.Open(str(scene))
for layer in stage.GetUsedLayers():
    print(layer.identifier.removeprefix(str(scene.parent.absolute())))

# %% [markdown]
# ## The same flight over both looks
# A variant is a small file beside the scene that selects something else.

# %%
roots = {path.stem.removeprefix("variant_"): path for path in sorted(scene.parent.glob("variant_*.usda"))}
settings = falsework.RenderSettings(quality="fast")
flights = {
    name: falsework.render(root, f"captures_{name}", settings=settings)["global"] for name, root in roots.items()
}
print(list(flights))

# %% [markdown]
# ## What changed
# Depth, classes and poses are equal to the last bit. The photographs are not.

# %%
import numpy as np

truths = [truth for flight in flights.values() if (truth := falsework.read_truth(flight))]
same = all(
    np.array_equal(truths[0].depth(image), other.depth(image))
    and np.array_equal(truths[0].semantic(image), other.semantic(image))
    and np.array_equal(truths[0].poses, other.poses)
    for other in truths[1:]
    for image in range(len(truths[0].poses))
)
photographs = {(flight.folder / "images/000000.jpg").read_bytes() for flight in flights.values()}
print("truth is the same:", same, "· different first photographs:", len(photographs))

# %%
from IPython.display import Image, display

for flight in flights.values():
    display(Image(filename=str(flight.folder / "images/000000.jpg"), width=480))

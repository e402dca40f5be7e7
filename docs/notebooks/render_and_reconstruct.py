"""Render a flight, and reconstruct it.

The renderer takes the place of a drone's camera. Structure from Motion uses only its photographs. The truth is used at
the end, for the class and the error of each point.
"""

# %% [markdown]
# ## A scene and its photographs

# %%
import falsework

scenario = {
    "seed": 7,
    "bridge": {"family": "beam", "service": "road", "beam": {"spans": [12.0]}},
    "background": {"name": "none"},
    "survey": [{"kind": "global", "images": 40, "width": 960, "height": 720}],
}
scene = falsework.author(scenario, "scene")
flight = falsework.render(scene, "captures", settings=falsework.RenderSettings(quality="fast"))["global"]

# %% [markdown]
# ## The truth beside them
# Depth is measured along the optical axis, in meters; the sky is infinitely far. Ids are exact: they are not mixed at
# edges.

# %%
import numpy as np

truth = falsework.read_truth(flight)
assert truth is not None  # photographs of your own have none
depth = truth.depth(0)
near = depth[np.isfinite(depth)]
print(depth.shape, "nearest", round(float(near.min()), 2), "m, median", round(float(np.median(near)), 2), "m")
print("instances in the first image:", len(np.unique(truth.instance(0))))

# %% [markdown]
# ## A cloud of the photographs alone
# `mode="dense"` gives a point for nearly every pixel and is recommended for training; `mode="sparse"` gives tie points
# only, and is faster.

# %%
dense = falsework.ReconSettings(mode="dense", quality="medium")
cloud = falsework.reconstruct(flight, "cloud", settings=dense)
names = {row.id: row.name for row in cloud.classes}
classes, counts = np.unique(cloud.columns["segment"], return_counts=True)
for number, count in zip(classes.tolist(), counts.tolist(), strict=True):
    print(f"{names[number]:<12}{count:>8}")

# %% [markdown]
# ## How far off
# `uncertainty` is the absolute difference of true and reconstructed depth: the median over the images that saw it.

# %%
uncertainty = cloud.columns["uncertainty"]
for limit in (0.01, 0.03, 0.1, 0.3, 1.0):
    print(f"within {limit:4} m: {100 * np.mean(uncertainty <= limit):5.1f} %")

# %%
import plotly.graph_objects as go
from IPython.display import display

some = np.random.default_rng(0).permutation(len(cloud))[:20_000]
colors = {row.id: f"rgb{tuple(row.color)}" for row in cloud.classes}
figure = go.Figure(
    go.Scatter3d(
        **dict(zip("xyz", cloud.columns["coord"][some].T, strict=True)),
        mode="markers",
        marker={"size": 1.5, "color": [colors[number] for number in cloud.columns["segment"][some].tolist()]},
    ),
    {"scene": {"aspectmode": "data"}},
)
display(figure)

"""Train a model, and label a scan.

The package brings small labeled clouds of random bridges. A forest learns from them here, since it needs no GPU and a
minute; the networks are trained by the same command. One bridge is kept for the test.
"""

# %% [markdown]
# ## Some data
# The commands of the shell, from Python:

# %%
import shlex
import subprocess


def run(line: str) -> None:
    """Run a command, and stop if it fails."""
    subprocess.run(shlex.split(line), check=True)


run("falsework dataset demo -o bridges")

# %% [markdown]
# `bridges/README.md` describes the clouds and their limits.

# %%
from pathlib import Path

import falsework

folders = sorted(path.parent for path in Path("bridges").glob("*/cloud.json"))
clouds = {folder.name: falsework.read_cloud(folder) for folder in folders}
print({name: len(cloud) for name, cloud in clouds.items()})

# %% [markdown]
# ## Cut them into training pieces
# Whole bridges are held out: pieces of one bridge are never in both training and test.

# %%
kept = "beam26"
sources = " ".join(str(folder) for folder in folders)
held = clouds[kept].bridge[:8]
run(
    f"falsework dataset local {sources} -o set --set points=1024 --set fewest=128 --set tile.size=10 "
    f"--set tile.stride=10 --set tile.voxel=0.5 --set 'test=[\"{held}\"]'"
)

# %% [markdown]
# ## Train, and score on the bridge that was kept

# %%
run("falsework train set -o model --model forest")
run("falsework evaluate model set -o scores.json")

# %%
print(Path("scores.md").read_text())

# %% [markdown]
# ## Label it as if it were a scan
# The copy has three more columns: class, confidence, instance.

# %%
run(f"falsework export bridges/{kept} --to laz -o scan")
run("falsework predict scan/cloud.laz -o labeled.laz --model model --link 0.5")

# %%
import laspy
import numpy as np

labeled = laspy.read("labeled.laz")
predicted, true = np.asarray(labeled["predicted_class"]), np.asarray(labeled["segment"])
print("classes that were found:", sorted(set(predicted.tolist())), "· points:", len(predicted))

"""Example commands below the help of each verb."""

EXAMPLES: dict[str, tuple[str, ...]] = {
    "doctor": ("falsework doctor",),
    "demo": ("falsework demo -o out",),
    "run": ("falsework run scenarios/demo.toml -o out", "falsework run bridges.toml -o out --workers 2"),
    "plan": ("falsework plan bridges.toml -o out",),
    "verify": ("falsework verify out", "falsework verify out --repair"),
    "clean": ("falsework clean out --dry-run",),
    "preview": (
        "falsework preview scenarios/demo.toml -o picture.png",
        "falsework preview bridges.toml -o picture.png --view ground --width 1920 --height 1080",
    ),
    "author": ("falsework author scenarios/demo.toml -o scene",),
    "render": (
        "falsework render scene/scene.usda -o captures",
        "falsework render from_blender.usda -o captures --camera Drone --width 1280 --frame 1:100:10",
    ),
    "reconstruct": (
        "falsework reconstruct captures/global -o cloud --mode dense --quality medium",
        "falsework reconstruct photos_of_a_bridge -o cloud --mode dense --gcp points.txt",
    ),
    "export": ("falsework export cloud --to laz -o for_others",),
    "report": (
        "falsework report out/scenes/0000 -o page.html",
        "falsework report cloud -o cloud.html",
        "falsework report out -o run.html",
        "falsework report model scores.json -o training.html",
    ),
    "view": ("falsework view out/scenes/0000", "falsework view out/scenes/0000 --save scene.html"),
    "gallery": (
        "falsework gallery families -o sheets",
        "falsework gallery combinations -o sheets --seed 7 --family arch --world city lakeside",
    ),
    "scene info": ("falsework scene info scene/scene.usda",),
    "scene validate": ("falsework scene validate scene",),
    "scene diff": ("falsework scene diff before/scene.usda after/scene.usda",),
    "scene set": (
        "falsework scene set scene look=aged background=none",
        "falsework scene set scene background=town.usdz light=sky.hdr",
    ),
    "scene checkout": ("falsework scene checkout out/scenes/0000 -o mine",),
    "scene import-edits": ("falsework scene import-edits edited.usdc mine/scene.usda --label Crate=wing_wall",),
    "scene flatten": ("falsework scene flatten scene/scene.usda -o flat.usdc",),
    "scene package": ("falsework scene package scene/scene.usda -o bridge.usdz",),
    "scene schemas": ("falsework scene schemas",),
    "background import": ("falsework background import city.glb -o city --up y",),
    "background info": ("falsework background info city",),
    "survey plan": ("falsework survey plan scene/scene.usda --kind inspection --for unseen",),
    "survey score": ("falsework survey score scene/scene.usda",),
    "sample mesh": ("falsework sample mesh scene/scene.usda -o points --set density=400",),
    "sample lidar": ("falsework sample lidar scene/scene.usda -o scan --kind terrestrial",),
    "dataset local": ("falsework dataset local out -o set",),
    "dataset global": ("falsework dataset global out -o set --table kim2023",),
    "dataset export": ("falsework dataset export set -o for_others --to s3dis",),
    "dataset demo": (
        "falsework dataset demo -o bridges",
        "falsework dataset demo -o bridges --photographs",
    ),
    "train": (
        "falsework train set -o model --model randlanet --epochs 30",
        "falsework train patchset -o mine --init shipped --freeze-encoder --set validation=0",
        "falsework train --demo -o model",
    ),
    "evaluate": ("falsework evaluate model set",),
    "compare": (
        "falsework compare learning -o sensors --preset sensor-matrix --plan",
        "falsework compare korea=pseudo-korea synthetic=learning illinois=pseudo-illinois -o out --preset task-local-1",
    ),
    "predict": ("falsework predict scan.laz -o labeled.laz --unit m",),
    "completion": ("falsework completion bash",),
}


def examples_for(words: list[str]) -> tuple[str, ...]:
    """Return the examples of the verb in a command line; none for a group of verbs.

    Args:
        words: Words after the program's name.
    """
    return EXAMPLES.get(" ".join(words[:2]), EXAMPLES.get(" ".join(words[:1]), ()))

"""The scenario: the settings of all stages in one TOML file; values that are not set are drawn from its seed."""

import hashlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Literal, Self

import tomli_w
from pydantic import Field, model_validator

from authoring.backgrounds.registry import BACKGROUNDS
from authoring.settings import AuthoringSettings
from groundwork.errors import InputError, MissingError
from groundwork.settings import Settings, parse_settings, read_toml
from recon.sampling.sampler_settings import AnySample, MeshSample, MobileSample
from recon.settings import ReconSettings
from render.settings import SensorSettings, ShadingSettings


class StageSource(Settings):
    """An existing stage to start from instead of authoring one."""

    path: str = Field(description="USD file, relative to the scenario")
    allow_root: tuple[str, ...] = Field(
        (), description="Other folders from which the stage may load files; results depend on all files in them"
    )


class Scenario(AuthoringSettings):
    """What `falsework run` makes."""

    seed: int = Field(7, ge=0, description="Seed of all random values")
    scenes: int = Field(1, ge=1, le=1_000_000, description="Number of scenes; each has its own seed")
    keep: tuple[Literal["stage", "capture", "model", "cloud", "report"], ...] = Field(
        ("stage", "capture", "model", "cloud", "report"),
        description="Stages whose results are kept; others are removed when no later stage needs them. Samples count "
        "as clouds",
    )
    stage: StageSource | None = Field(None, description="Start from this stage instead of authoring one")
    worlds: dict[str, str] = Field(
        default_factory=dict,
        description="Imported worlds: name for `[background]` = path, relative to the scenario",
    )
    skies: dict[str, str] = Field(
        default_factory=dict,
        description="Photographed skies: name for `[light] sky` = path, relative to the scenario",
    )
    surfaces: dict[str, str] = Field(
        default_factory=dict,
        description="Folders or zips of surfaces: name for `[look] folders` = path, relative to the scenario",
    )
    render: ShadingSettings = Field(default_factory=ShadingSettings, description="Settings of the renderer")
    sensor: SensorSettings = Field(default_factory=SensorSettings, description="The sensor of the camera")
    recon: ReconSettings = Field(default_factory=ReconSettings, description="Settings of the reconstruction")
    sample: tuple[AnySample, ...] = Field(
        default=(), description="Clouds sampled from the surface of the stage, without images"
    )

    @model_validator(mode="before")
    @classmethod
    def _samples_need_no_flight(cls, values: Any) -> Any:
        if isinstance(values, dict) and values.get("sample") and not {"survey", "stage"} & values.keys():
            return {**values, "survey": ()}
        return values

    @model_validator(mode="after")
    def _samples_fit(self) -> Self:
        if not self.survey and not self.sample:
            raise ValueError("neither a survey nor a sample; allowed: at least one [[survey]] or [[sample]]")
        flown = [survey.id for survey in self.survey] if self.stage is None else []
        ids = [*flown, *(sample.id for sample in self.sample)]
        if len({name.lower() for name in ids}) < len(ids):  # some disks do not tell cases apart
            raise ValueError(f"two clouds have the same id; allowed: a different id each, found {', '.join(ids)}")
        for sample in self.sample if self.stage is None else ():
            if isinstance(sample, MeshSample) and sample.min_views and not self.survey:
                raise ValueError(
                    f"sample {sample.id} has min_views, which needs cameras; allowed: only with a [[survey]]"
                )
            named = sample.survey if isinstance(sample, MeshSample) else ""
            named = sample.path if isinstance(sample, MobileSample) and sample.path != "deck" else named
            if named and named not in flown:
                raise ValueError(
                    f"sample {sample.id} names {named!r}, which is not a survey; allowed: {', '.join(flown)}"
                )
        return self

    def authoring(self) -> dict[str, Any]:
        """Return the sections that a stage is authored from, as JSON."""
        return self.model_dump(mode="json", include=set(AuthoringSettings.model_fields))

    def rendering(self) -> dict[str, Any]:
        """Return the settings of the renderer, as JSON."""
        return {**self.render.model_dump(mode="json"), "sensor": self.sensor.model_dump(mode="json")}

    def as_toml(self, folder: Path | None = None) -> str:
        """Format the scenario as TOML, including defaults.

        Args:
            folder: Folder of the file, to which its paths become relative; None: absolute paths.
        """
        values = self.model_dump(mode="json", exclude_none=True, exclude=None if self.sample else {"sample"})
        if folder is not None:
            base = os.path.realpath(folder)
            for section in ("worlds", "skies", "surfaces"):
                values[section] = {
                    name: os.path.relpath(os.path.realpath(path), base) for name, path in values[section].items()
                }
            if self.stage is not None:
                roots = [os.path.relpath(os.path.realpath(root), base) for root in self.stage.allow_root]
                path = os.path.relpath(os.path.realpath(self.stage.path), base)
                values["stage"] = {"path": path, "allow_root": roots}
        return tomli_w.dumps(values)


def load_scenario(path: Path | str) -> Scenario:
    """Read a scenario file.

    Args:
        path: TOML file; relative paths in it are relative to its folder.

    Returns:
        The scenario, with absolute paths, which are valid in every process of a run.

    Raises:
        InputError: Missing, not TOML, or a key or value that is not allowed.
    """
    return scenario_of(read_toml(Path(path)), Path(path))


def scenario_of(values: Mapping[str, Any], path: Path = Path("scenario")) -> Scenario:
    """Validate a scenario given as a dict of sections and keys.

    Args:
        values: Sections and keys, as in a TOML file.
        path: Name of the scenario in errors; relative paths are relative to its folder, by default the current one.

    Returns:
        The scenario, with absolute paths.

    Raises:
        InputError: A key or value that is not allowed.
    """
    if not isinstance(values, Mapping):
        raise InputError("not a mapping of sections and keys", value=values, hint="To read a file, use load_scenario")
    given = parse_settings(Scenario, dict(values), path)
    try:
        return _with_stage(_with_surfaces(_with_skies(_with_worlds(given, path), path), path), path)
    except OSError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"a path that cannot exist: {error.strerror}", where=path, hint="Shorten it") from None


def _with_stage(scenario: Scenario, path: Path) -> Scenario:
    """Make the path of the scenario's stage, if any, absolute."""
    if scenario.stage is None:
        return scenario
    if scenario.variants.combinations():
        raise InputError(
            "[variants] cannot be combined with an existing stage",
            where=path,
            field="variants",
            hint="Run falsework scene set SCENE look=… --variant NAME, then use variant_NAME.usda as stage",
        )
    stage = _beside(path, scenario.stage.path)
    if not stage.exists():
        raise MissingError("no such stage", where=path, field="stage.path", value=scenario.stage.path)
    roots = tuple(str(_beside(path, root)) for root in scenario.stage.allow_root)
    return scenario.model_copy(update={"stage": StageSource(path=str(stage), allow_root=roots)})


def _beside(scenario: Path, place: str) -> Path:
    """Make a path of a scenario absolute; links are not resolved, so that their names are kept."""
    return Path(os.path.abspath(scenario.parent / place))  # noqa: PTH100 - `resolve` would follow links


def _with_worlds(scenario: Scenario, path: Path) -> Scenario:
    """Give every imported world of the scenario an absolute path and a name."""
    from authoring.imported.asset import claims_city, world_name

    worlds = {name: str(_beside(path, place)) for name, place in scenario.worlds.items()}

    def named(background: str) -> str:
        if background in BACKGROUNDS or background in worlds:
            return background
        place = _beside(path, background)
        if not place.exists():
            raise MissingError(
                "no such background",
                where=path,
                field="background.name",
                value=background,
                allowed=", ".join((*BACKGROUNDS, *worlds)),
                hint="Choose one of these, or the path of a world made by falsework background import",
            )
        return _add_file(worlds, world_name(place), place, "worlds", path)

    name = named(scenario.background.name)
    others = tuple(named(background) for background in scenario.variants.background)
    _check_world_names(worlds, path)
    if len(set(others)) < len(others):
        raise InputError("one world twice", where=path, field="variants.background", value=list(others))
    for world in map(Path, worlds.values()):
        if not world.exists():
            raise MissingError("no such world", where=path, field="worlds", value=str(world))
        if world.is_file() and not claims_city(world):  # otherwise its whole folder would count as the world
            from authoring.variants.add import USD_FILES

            hint = "Import it with falsework background import FILE -o DIR"
            if world.suffix in USD_FILES:
                hint += ", or add the file to a finished scene with falsework scene set SCENE background=FILE"
            raise InputError("is not an imported world", where=path, field="worlds", value=str(world), hint=hint)
    return scenario.model_copy(
        update={
            "worlds": worlds,
            "background": scenario.background.model_copy(update={"name": name}),
            "variants": scenario.variants.model_copy(update={"background": others}),
        }
    )


def _check_world_names(worlds: Mapping[str, str], path: Path) -> None:
    """Refuse names that no variant set takes, and those of our own backgrounds."""
    from authoring.foreign.usd_file import safe_name

    for name in worlds:
        if name.lower() in BACKGROUNDS:
            hint = "Rename it, or give it another name in [worlds] and use that as background"
            raise InputError(
                "has the name of a background of Falsework", where=path, field="worlds", value=name, hint=hint
            )
        if name != safe_name(name):
            raise InputError(
                "not a name of a world",
                where=path,
                field="worlds",
                value=name,
                allowed="letters, digits and _, beginning with a letter",
                hint=f"Call it {safe_name(name)}",
            )


def _add_file(known: dict[str, str], name: str, place: Path, kind: str, scenario: Path) -> str:
    """Add a file under its own name; another file of this name would replace it, also where case does not count."""
    same = next((other for other in known if other.lower() == name.lower()), name)
    if known.setdefault(same, str(place)) != str(place):
        raise InputError(
            "two files have the same name",
            where=scenario,
            field=kind,
            value=name,
            hint=f"Rename one of them, or give it another name in [{kind}]",
        )
    return same


def _with_skies(scenario: Scenario, path: Path) -> Scenario:
    """Give every photographed sky of the scenario an absolute path and a name."""
    skies = {name: str(_beside(path, place)) for name, place in scenario.skies.items()}

    def named(sky: str) -> str:
        if sky in ("", *skies):
            return sky
        return _add_file(skies, Path(sky).name, _beside(path, sky), "skies", path)

    base = scenario.light.model_copy(update={"sky": named(scenario.light.sky)})
    lights = tuple(light.model_copy(update={"sky": named(light.sky)}) for light in scenario.variants.light)
    # A copy would count `sky` as set: a light that does not set it uses that of the base.
    lights = tuple(
        new if "sky" in old.model_fields_set else old for new, old in zip(lights, scenario.variants.light, strict=True)
    )
    for sky in skies.values():
        if not Path(sky).is_file():
            raise MissingError("no such sky", where=path, field="light.sky", value=sky)
    variants = scenario.variants.model_copy(update={"light": lights})
    return scenario.model_copy(update={"skies": skies, "light": base, "variants": variants})


def _with_surfaces(scenario: Scenario, path: Path) -> Scenario:
    """Give every folder of surfaces of the scenario an absolute path and a name."""
    surfaces = {name: str(_beside(path, place)) for name, place in scenario.surfaces.items()}
    names = []
    for folder in scenario.look.folders:
        is_named = folder in surfaces
        place = _beside(path, folder)
        names.append(folder if is_named else _add_file(surfaces, Path(folder).name, place, "surfaces", path))
    for place in surfaces.values():
        if not Path(place).exists():
            raise MissingError("no such folder of surfaces", where=path, field="look.folders", value=place)
    look = scenario.look.model_copy(update={"folders": tuple(names)})
    return scenario.model_copy(update={"surfaces": surfaces, "look": look})


@contextmanager
def values_of(path: Path) -> Iterator[None]:
    """Add the scenario's path to errors that its values cause later, such as a bridge that cannot be built.

    Args:
        path: TOML file of the values.
    """
    try:
        yield
    except InputError as error:
        error.found_in(path)
        raise


def demo_scenario() -> Scenario:
    """Read the demo's scenario from the package."""
    with as_file(files("falsework").joinpath("scenarios/demo.toml")) as path:
        return load_scenario(path)


def given_files(scenario: Scenario) -> dict[str, Path]:
    """List the imported worlds, photographed skies and folders of surfaces: inputs of the authoring task.

    Args:
        scenario: The scenario.
    """
    places = {name: Path(place) for name, place in sorted(scenario.worlds.items())}
    worlds = {f"world/{name}": place if place.is_dir() else place.parent for name, place in places.items()}
    skies = {f"sky/{name}": Path(place) for name, place in sorted(scenario.skies.items())}
    return {**worlds, **skies, **{f"surface/{name}": Path(place) for name, place in sorted(scenario.surfaces.items())}}


def scene_seed(seed: int, index: int) -> int:
    """Derive the seed of one scene.

    Args:
        seed: Seed of the scenario.
        index: Number of the scene.

    Returns:
        A number below 2^31 that depends on these two values only.
    """
    return int.from_bytes(hashlib.sha256(f"{seed}/{index}".encode()).digest()[:4], "little") >> 1


def scene_title(index: int, seed: int) -> str:
    """Name a scene by its number and the seed of the scenario.

    Args:
        index: Number of the scene.
        seed: Seed of the scenario.
    """
    return f"Scene {index:04d} of seed {seed}"

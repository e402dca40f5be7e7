"""Which settings a result's name in the store depends on: every one of them, held by changing each."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from authoring.settings import AuthoringSettings
from falsework.execution import chain
from falsework.execution.chain import read_sources, scene_chain
from falsework.scenario import Scenario
from falsework.stages import STAGES
from groundwork.progress import SILENT, DistinctNotes
from recon.settings import ReconSettings
from tests.falsework.tiny_chain import tiny_scenario

LIMITS = {"threads", "seconds_per_image", "memory_limit", "memory_per_image", "memory_per_megapixel"}
OF_KIND = ((bool, True), (int, 5), (float, 0.25))
OF_FRAMES = {"workers", "encoders"}
OF_DENSE = {("quality",), ("filter",)}
OF_SPARSE = {("max_reprojection_error",), ("min_views",), ("sure_views",), ("max_deviation",)}


@pytest.fixture(autouse=True)
def no_platform(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask no driver."""
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": "none"})
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none"})


def keys(recon: ReconSettings) -> dict[str, str]:
    """Give the key of every step of a scene whose clouds are both made, by what it is."""
    return keys_of(tiny_scenario().model_copy(update={"recon": recon}))


def keys_of(scenario: Scenario) -> dict[str, str]:
    """Give the key of every step of a scene, by what it is."""
    found = scene_chain(scenario, 0, read_sources(scenario, SILENT))
    return {step.link.partition("+")[2] or step.task.stage: step.task.key for step in (*found.steps, found.report())}


def leaves(model: BaseModel, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Name every setting below a section."""
    for name in type(model).model_fields:
        value = getattr(model, name)
        yield from leaves(value, (*path, name)) if isinstance(value, BaseModel) else [(*path, name)]


def changed(model: Any, path: tuple[str, ...]) -> Any:
    """Change one setting to another value that is allowed."""
    name, *rest = path
    value = getattr(model, name)
    if rest:
        return model.model_copy(update={name: changed(value, tuple(rest))})
    return model.model_copy(update={name: another(value, type(model).model_fields[name].annotation)})


def another(value: Any, kind: Any) -> Any:
    """Give another value, allowed where settings of the reconstruction need it, as these are read again."""
    match value:
        case bool():
            return not value
        case int():
            return value + 1
        case float():
            return value * 0.99 if value else 0.25
        case None:
            kinds = {inner for choice in get_args(kind) for inner in (choice, *get_args(choice))}
            return next((other for of, other in OF_KIND if of in kinds), "x")
        case dict():
            return {**value, "x": 1.0}
        case tuple() | list():
            return (*value, "x")
        case _:
            return next((choice for choice in get_args(kind) if isinstance(choice, str) and choice != value), "x")


def wanted(path: tuple[str, ...]) -> set[str]:
    """Tell what a setting changes, beside the report."""
    if path[-1] in LIMITS:
        return set()
    if path in OF_DENSE or path[0] == "dense":
        return {"dense"}
    if path in OF_SPARSE:
        return {"sparse"}
    if path[0] == "alignment":
        return {"sparse", "dense"}
    assert path == ("seed",) or path[0] == "sparse", f"nobody has thought about {path}"
    return {"model", "sparse", "dense"}


@pytest.mark.parametrize("path", [path for path in leaves(ReconSettings()) if path != ("mode",)], ids=".".join)
def test_every_setting_of_the_reconstruction_counts_where_it_works(path: tuple[str, ...]) -> None:
    """One of the cameras changes model and clouds, one of a cloud that cloud alone, a limit of the work nothing."""
    base = ReconSettings(mode="both")
    before, after = keys(base), keys(changed(base, path))
    moved = {name for name in before if before[name] != after[name]}
    assert moved == (wanted(path) | {"report"} if wanted(path) else set())


@pytest.mark.parametrize("section", ["render", "sensor"])
def test_every_setting_of_the_renderer_counts(section: str) -> None:
    """Each moves the capture and what is made from it, and no stage; those of the work alone move nothing."""
    base = tiny_scenario()
    before = keys_of(base)
    for path in leaves(getattr(base, section)):
        after = keys_of(changed(base, (section, *path)))
        moved = {name for name in before if before[name] != after[name]}
        assert moved == (set() if path[-1] in OF_FRAMES else set(before) - {"stage"}), path


@pytest.mark.filterwarnings("ignore:Pydantic serializer warnings")  # values that nobody has read yet
@pytest.mark.parametrize("section", sorted(set(AuthoringSettings.model_fields) - {"survey", "variants"}))
def test_every_setting_of_a_stage_counts(section: str) -> None:
    """Each moves the stage, and so everything."""
    base = tiny_scenario()
    before, value = keys_of(base), getattr(base, section)
    paths = [(section, *path) for path in leaves(value)] if isinstance(value, BaseModel) else [(section,)]
    for path in paths:
        after = keys_of(changed(base, path))
        assert all(before[name] != after[name] for name in before), path


def test_threads_count_where_the_mapper_uses_them() -> None:
    """A mapper that is not deterministic gives other bytes with other threads."""
    loose = changed(ReconSettings(mode="both"), ("sparse", "deterministic"))
    assert keys(loose)["model"] != keys(changed(loose, ("sparse", "threads")))["model"]


def test_clouds_are_the_same_alone_and_together() -> None:
    """Which other cloud is made changes neither model nor cloud."""
    both = keys(ReconSettings(mode="both"))
    for mode in ("sparse", "dense"):
        alone = keys(ReconSettings(mode=mode))
        assert (alone["model"], alone["cloud"]) == (both["model"], both[mode])


@pytest.mark.parametrize("mode", ["sparse", "dense", "both"])
def test_work_is_done_with_the_settings_of_the_user(mode: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Key and limits together give a stage every setting that it looks at."""
    base = ReconSettings(mode=mode)
    for path in leaves(base):
        base = base if path == ("mode",) else changed(base, path)
    got: list[ReconSettings] = []
    monkeypatch.setattr("recon.reconstruct.reconstruct_model", lambda *given: got.append(given[2]))
    monkeypatch.setattr("recon.reconstruct.reconstruct_cloud", lambda *given: got.append(given[3]))
    scenario = tiny_scenario().model_copy(update={"recon": base})
    (flight,) = scene_chain(scenario, 0, read_sources(scenario, SILENT)).flights
    for step in (flight.model, *flight.clouds):
        inputs: dict[str, Path] = {"capture": tmp_path, "model": tmp_path}
        STAGES[step.task.stage].run({**step.task.settings, **step.task.manner}, inputs, tmp_path, SILENT)
    model, *clouds = got
    assert (model.sparse, model.seed) == (base.sparse, base.seed)
    assert [cloud.mode for cloud in clouds] == list(base.modes)
    for cloud in clouds:
        looked_at = {"quality", "filter", "dense"} if cloud.mode == "dense" else {"min_views", "sure_views"}
        for name in ("alignment", "seed", *looked_at):
            assert getattr(cloud, name) == getattr(base, name)
        assert cloud.sparse.memory_limit == base.sparse.memory_limit
        assert cloud.dense.threads == base.dense.threads


def test_a_stage_counts_by_its_name_and_the_files_that_it_loads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two stages of one folder have two results; a link to a stage has its results, and changes with its files."""
    monkeypatch.setattr(chain, "sample_platform", lambda: {"cpu": "none"})
    for name in ("in", "links"):
        (tmp_path / name).mkdir()
    for name in ("bridge", "other"):
        (tmp_path / f"in/{name}.usda").write_text("#usda 1.0\n")
    (tmp_path / "links/mine.usda").symlink_to(tmp_path / "in/bridge.usda")

    def names(path: str) -> set[str]:
        stage = {"path": str(tmp_path / path)}
        scenario = tiny_scenario(survey=[], sample=[{"kind": "mesh"}], stage=stage)
        found = scene_chain(scenario, 0, read_sources(scenario, SILENT))
        return {step.task.key for step in (*found.steps, found.report())}

    before = names("in/bridge.usda")
    assert not before & names("in/other.usda")
    assert names("links/mine.usda") == before
    (tmp_path / "in/rust.png").write_bytes(b"rust")
    assert not before & names("links/mine.usda")
    assert names("links/mine.usda") == names("in/bridge.usda")


def test_files_of_further_roots_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A change in a folder of `allow_root` renames all results; one beside the stage is no news."""
    monkeypatch.setattr(chain, "sample_platform", lambda: {"cpu": "none"})
    for name in ("in", "in/textures", "library"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "bridge.usda").write_text("#usda 1.0\n")

    def names(*roots: str) -> set[str]:
        stage = {"path": str(tmp_path / "in/bridge.usda"), "allow_root": [str(tmp_path / root) for root in roots]}
        scenario = tiny_scenario(survey=[], sample=[{"kind": "mesh"}], stage=stage)
        found = scene_chain(scenario, 0, read_sources(scenario, SILENT))
        return {step.task.key for step in (*found.steps, found.report())}

    plain, before = names(), names("library")
    assert names("in/textures") == plain
    assert len(plain) == 2
    (tmp_path / "library/bridge.usda").write_text("#usda 1.0\n# changed\n")
    assert names() == plain
    assert not names("library") & (before | plain)


def test_files_that_a_stage_must_not_read_do_not_count(tmp_path: Path) -> None:
    """A link beside the stage to an archive of terabytes is not followed; a root may be a single file."""
    for name in ("in", "archive"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "bridge.usda").write_text("#usda 1.0\n")
    texture = tmp_path / "archive/texture.png"
    texture.write_bytes(b"first")

    def found(*roots: Path) -> str:
        stage = {"path": str(tmp_path / "in/bridge.usda"), "allow_root": [str(root) for root in roots]}
        scenario = tiny_scenario(survey=[], sample=[{"kind": "mesh"}], stage=stage)
        return read_sources(scenario, SILENT).digests[chain.FOREIGN_STAGE]

    plain, with_root = found(), found(texture)
    (tmp_path / "in/archive").symlink_to(tmp_path / "archive")
    assert found() == plain
    assert len({plain, found(tmp_path / "archive")}) == 2
    (tmp_path / "in/archive").unlink()
    texture.write_bytes(b"second")
    assert found(texture) != with_root


def test_a_large_input_is_announced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line before it is read, with its size; none for a small one, nor for runs beside a stage."""
    monkeypatch.setattr(chain, "LARGE", 1000)
    for name, size in {"in/s.usda": 100, "in/out/big.bin": 5000, "world/w.usda": 4000, "few/w.usda": 10}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"#" * size)
    (tmp_path / "in/out/.falsework").write_text("run\n")
    said: list[str] = []
    told = DistinctNotes(SILENT)
    monkeypatch.setattr(told, "note", said.append)
    sought: list[str] = []
    seek = chain.outputs_below
    monkeypatch.setattr(chain, "outputs_below", lambda place, kind: sought.append(place.name) or seek(place, kind))
    worlds = {name: str(tmp_path / name) for name in ("world", "few")}
    read_sources(tiny_scenario(worlds=worlds), told)
    read_sources(tiny_scenario(survey=[], sample=[{"kind": "mesh"}], stage={"path": str(tmp_path / "in/s.usda")}), told)
    assert said == [f"{tmp_path}/world: 0.0 GB are read, since results depend on their content"]
    assert sought == ["world", "in"]  # a small input is walked once

"""Scenarios: what a user may get wrong costs one clear line."""

import re
from pathlib import Path

import pytest

from falsework.execution.parts import scene_range, shard_of
from falsework.scenario import Scenario, demo_scenario, given_files, load_scenario, scene_seed
from groundwork.errors import InputError
from groundwork.settings import parse_settings, read_toml

BAD = {
    "unknown key": ("[brigde]\nfamily = 'beam'", ["brigde", "Did you mean 'bridge'"]),
    "unknown inner key": ("[recon]\nmod = 'sparse'", ["recon.mod", "Did you mean 'mode'"]),
    "unknown survey key": (
        "[[survey]]\nkind = 'global'\nimagse = 5",
        ["survey.0.imagse: unknown key", "Did you mean 'images'"],
    ),
    "survey without a kind": ("[[survey]]\nlength = 30.0", ["survey.0.kind", "global, local, grid"]),
    "survey of no kind": ("[[survey]]\nkind = 'lokal'", ["survey.0.kind", "'lokal'", "global, local, grid"]),
    "unknown key of one kind": ("[[survey]]\nkind = 'local'\nlenght = 3.0", ["lenght", "Did you mean 'length'"]),
    "same id twice": ("[[survey]]\nkind = 'grid'\n[[survey]]\nkind = 'grid'", ["same id", "grid, grid"]),
    "ids that differ by case": (
        "[[survey]]\nkind = 'grid'\nid = 'a'\n[[survey]]\nkind = 'grid'\nid = 'A'",
        ["same id", "a, A"],
    ),
    "a sample's id by case": ("[[survey]]\nkind = 'grid'\n[[sample]]\nkind = 'mesh'\nid = 'Grid'", ["grid, Grid"]),
    "a light's name by case": ("[[variants.light]]\nname = 'a'\n[[variants.light]]\nname = 'A'", ["twice", "a, A"]),
    "a world called none": ("[worlds]\nnone = '.'", ["worlds: has the name of a background", "'none'", "another name"]),
    "a world called like ours": ("[background]\nname = './City'", ["worlds: has the name of a background", "'City'"]),
    "a world without a name": ("[worlds]\n'my world' = '.'", ["not a name of a world", "Call it my_world"]),
    "two worlds of one name": (
        "[background]\nname = 'a/town'\n[variants]\nbackground = ['b/Town']",
        ["worlds: two files have the same name", "'Town'"],
    ),
    "one world twice": ("[worlds]\nx = 'City'\n[variants]\nbackground = ['x', 'Day']", ["Day"]),
    "two skies of one name": (
        "[light]\nsky = 'a/s.hdr'\n[[variants.light]]\nname = 'x'\nsky = 'b/s.hdr'",
        ["skies: two files have the same name", "'s.hdr'", "[skies]"],
    ),
    "two surfaces of one name": ("[look]\nfolders = ['a/town', 'b/town']", ["surfaces: two files have the same name"]),
    "wrong type": ("seed = 'seven'", ["seed", "'seven'", "should be a number"]),
    "out of range": ("scenes = 0", ["scenes", "0", "greater than or equal to 1"]),
    "endless": ("scenes = 999999999999999999", ["scenes", "less than or equal to 1000000"]),
    "wrong choice": ("[render]\nquality = 'best'", ["render.quality", "'best'", "standard"]),
    "missing stage": ("[stage]\npath = 'nowhere.usda'", ["stage.path", "nowhere.usda"]),
    "unknown variant": ("[variants]\nlook = ['shiny']", ["variants", "'shiny'", "weathered"]),
    "variant twice": ("[variants]\nlook = ['clean', 'clean']", ["variants", "twice"]),
    "light without a name": ("[[variants.light]]\nbrightness = 1.0", ["variants.light.0.name: is missing", "Add it"]),
    "variants of a stage": ("[stage]\npath = 's.usda'\n[variants]\nlook = ['clean']", ["variants", "scene set"]),
    "nothing to make": ("survey = []", ["neither a survey nor a sample"]),
    "sample of no kind": ("[[sample]]\nkind = 'photo'", ["sample.0.kind", "'photo'", "mesh, terrestrial, mobile"]),
    "unknown key of a sample": ("[[sample]]\nkind = 'mesh'\nvoxle = 1", ["voxle", "Did you mean 'voxel'"]),
    "two samples of one id": ("[[sample]]\nkind = 'mesh'\n[[sample]]\nkind = 'mesh'", ["same id", "mesh, mesh"]),
    "sample named as a survey": (
        "[[survey]]\nkind = 'grid'\n[[sample]]\nkind = 'mesh'\nid = 'grid'",
        ["same id", "grid, grid"],
    ),
    "views without a flight": ("[[sample]]\nkind = 'mesh'\nmin_views = 1", ["min_views", "[[survey]]"]),
    "views of no survey": (
        "[[survey]]\nkind = 'grid'\n[[sample]]\nkind = 'mesh'\nmin_views = 1\nsurvey = 'local'",
        ["'local'", "grid"],
    ),
    "path of no survey": ("[[sample]]\nkind = 'mobile'\npath = 'local'", ["mobile", "'local'"]),
    "a section that is a word": ("background = 'city'", ["background: should be a section, [background]", "'city'"]),
    "one bracket": ("[survey]\nkind = 'global'", ["survey: should be a list: write [[survey]]"]),
    "families in a list": ("[bridge]\nfamily = ['beam', 'girder']", ["bridge.family: should be a name, or a table"]),
    "true for a number": ("seed = true", ["seed: should be a number (found True)"]),
    "text for a number": ("[render]\nshadow_size = '512'", ["render.shadow_size: should be a number (found '512')"]),
    "a number for true": ("[bridge.fittings]\nlamps = 1", ["bridge.fittings.lamps: should be true or false (found 1)"]),
    "true in a list": (
        "[bridge.beam]\nspans = [true]",
        ["bridge.beam.spans: should be a list, each of it a number (found [True])"],
    ),
    "no date": ("[light]\ndate = 'noon'", ["light.date: should be a date and hour, such as"]),
    "nothing like it": ("[light]\ntime = 3", ["light.time: unknown key", "Remove it"]),
    "not TOML": ("seed = = 7", ["line 1"]),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_scenario_is_one_line(case: str, tmp_path: Path) -> None:
    """The line names the file, the field, the value and the mend."""
    text, parts = BAD[case]
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    for name in ("City", "a/town", "b/town", "b/Town"):
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    message = str(caught.value)
    assert "\n" not in message
    assert [part for part in ["scenario.toml", *parts] if part not in message] == []


def test_toml_round_trip(tmp_path: Path) -> None:
    """A scenario written down reads back as itself."""
    scenario = demo_scenario()
    path = tmp_path / "again.toml"
    path.write_text(scenario.as_toml())
    assert parse_settings(Scenario, read_toml(path), path) == scenario


def test_variants_are_a_product() -> None:
    """Two looks and two lights are four variants; a light keeps what it does not say from the scenario's own."""
    light = {"date": "2024-06-21T14:00", "cloud_cover": 0.9}
    variants = {
        "look": ["clean", "weathered"],
        "light": [{"name": "noon"}, {"name": "dusk", "date": "2024-06-21T20:00"}],
    }
    scenario = parse_settings(Scenario, {"light": light, "variants": variants}, "test")
    names = list(scenario.variants.combinations())
    assert names == ["clean_noon", "clean_dusk", "weathered_noon", "weathered_dusk"]
    lights = scenario.variants.lights(scenario.light)
    assert list(lights) == ["default", "noon", "dusk"]
    assert lights["noon"] == lights["default"]
    assert lights["dusk"].cloud_cover == 0.9
    assert lights["dusk"].date.hour == 20
    assert parse_settings(Scenario, {}, "test").variants.combinations() == {}


@pytest.mark.parametrize(
    ("variants", "words"),
    [
        ({"light": [{"name": "default", "cloud_cover": 1.0}]}, "'default' is the light of [light]"),
        (
            {"background": ["none", "none_a"], "light": [{"name": "a_b"}, {"name": "b"}]},
            "two variants would have the name none_a_b",
        ),
    ],
)
def test_a_variant_has_a_name_of_its_own(variants: dict[str, object], words: str) -> None:
    """No second light has the name of `[light]`, and no two products of the lists are joined to one name."""
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        parse_settings(Scenario, {"variants": variants}, "test")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("date", [2024, "2024", "2024-06-21", "2024-06-31T14:00", 1.7e9, "noon", "0024-06-21T14:00"])
def test_a_date_has_a_day_and_an_hour(date: object) -> None:
    """No number of seconds since 1970, and no midnight where the hour was left out."""
    with pytest.raises(InputError, match=r"test: light\.date: .*(such as 2024-06-21T14:00|1900 to 2100)") as caught:
        parse_settings(Scenario, {"light": {"date": date}}, "test")
    assert "\n" not in str(caught.value)


def test_scene_seeds_differ_and_stay() -> None:
    """Seeds of scenes are distinct, and are the same on every machine and day."""
    seeds = {scene_seed(seed, index) for seed in range(20) for index in range(50)}
    assert len(seeds) == 1000
    assert scene_seed(7, 0) == 648731404


@pytest.mark.parametrize("text", ["3", "2:1", "0:99", "a:b", "-1:2"])
def test_bad_scene_range(text: str) -> None:
    """A part of the scenes that does not exist is refused."""
    with pytest.raises(InputError, match="--scenes"):
        scene_range(text, 10)


def test_good_scene_ranges() -> None:
    """Either side of a range may be left out."""
    assert [scene_range(text, 10) for text in (None, ":", "2:", ":3", "4:6")] == [
        range(10),
        range(10),
        range(2, 10),
        range(3),
        range(4, 6),
    ]


def test_imported_world_is_found_beside_the_scenario(tmp_path: Path) -> None:
    """A path as the background's name, or in a variant, becomes a name and an input; an absent one is an error."""
    (tmp_path / "cities/hague").mkdir(parents=True)
    (tmp_path / "cities/the-hague.1").mkdir()
    file = tmp_path / "scenario.toml"
    file.write_text('[background]\nname = "cities/hague"\n[variants]\nbackground = ["cities/hague", "none"]\n')
    scenario = load_scenario(file)
    assert scenario.background.name == "hague"
    assert scenario.variants.background == ("hague", "none")
    assert given_files(scenario) == {"world/hague": tmp_path / "cities/hague"}
    file.write_text('[background]\nname = "cities/the-hague.1"\n')  # the name that scene set gives it
    assert given_files(load_scenario(file)) == {"world/the_hague_1": tmp_path / "cities/the-hague.1"}
    file.write_text('[background]\nname = "cities/delft"\n')
    with pytest.raises(InputError, match=r"no such background.*cities/delft.*countryside"):
        load_scenario(file)


def test_a_photographed_sky_has_a_name_and_a_path(tmp_path: Path) -> None:
    """The path counts from the scenario, the settings keep the name alone; a missing picture is told by field."""
    (tmp_path / "skies").mkdir()
    (tmp_path / "skies/park.hdr").write_bytes(b"")
    path = tmp_path / "scenario.toml"
    path.write_text('[light]\nsky = "skies/park.hdr"\n[[variants.light]]\nname = "again"\n')
    scenario = load_scenario(path)
    assert scenario.light.sky == "park.hdr"
    assert scenario.variants.lights(scenario.light)["again"].sky == "park.hdr"
    assert given_files(scenario) == {"sky/park.hdr": tmp_path / "skies/park.hdr"}
    assert str(tmp_path) not in str(scenario.authoring())
    path.write_text('[light]\nsky = "skies/gone.hdr"\n')
    with pytest.raises(InputError, match=r"light\.sky"):
        load_scenario(path)


def test_its_paths_hold_in_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scenario that was named from where its user stands leads to the same files from everywhere else."""
    for name in ("in/world", "in/more", "in/wood", "in/stone"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("in/day.hdr", "in/dusk.hdr", "in/stage.usda"):
        (tmp_path / name).write_bytes(b"")
    authored = tmp_path / "in/authored.toml"
    authored.write_text(
        '[background]\nname = "world"\n[worlds]\nmore = "more"\n[light]\nsky = "day.hdr"\n'
        '[skies]\nlater = "dusk.hdr"\n[look]\nfolders = ["wood"]\n[surfaces]\nstone = "stone"\n'
    )
    (tmp_path / "in/given.toml").write_text('[stage]\npath = "stage.usda"\nallow_root = ["../in", "more"]\n')
    monkeypatch.chdir(tmp_path)
    scenario, given = load_scenario(Path("in/authored.toml")), load_scenario(Path("in/given.toml")).stage
    monkeypatch.chdir("/")
    names = {
        "world/more": "more",
        "world/world": "world",
        "sky/day.hdr": "day.hdr",
        "sky/later": "dusk.hdr",
        "surface/stone": "stone",
        "surface/wood": "wood",
    }
    assert given_files(scenario) == {name: tmp_path / "in" / place for name, place in names.items()}
    assert given is not None
    assert given.path == str(tmp_path / "in/stage.usda")
    assert given.allow_root == (str(tmp_path / "in"), str(tmp_path / "in/more"))
    monkeypatch.chdir(tmp_path / "in")
    assert load_scenario(Path("authored.toml")) == scenario == load_scenario(authored)


@pytest.mark.parametrize("text", ['[background]\nname = "town.usda"\n', '[worlds]\ntown = "town.usda"\n'])
def test_a_loose_usd_file_is_no_world(text: str, tmp_path: Path) -> None:
    """A loose USD file is refused with the two ways to use it, a GLB with its one; the root layer of a world is not."""
    (tmp_path / "town.usda").write_text('#usda 1.0\ndef Xform "Town" {}\n')
    file = tmp_path / "s.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"is not an imported world.*background import.*scene set"):
        load_scenario(file)
    (tmp_path / "town.glb").write_bytes(b"glTF")
    file.write_text(text.replace("usda", "glb"))
    with pytest.raises(InputError, match=r"is not an imported world.*background import FILE -o DIR$"):
        load_scenario(file)
    file.write_text(text)
    data = 'customLayerData = {\n string "falsework:city" = "{}"\n }'
    (tmp_path / "town.usda").write_text(f"#usda 1.0\n(\n    {data}\n)\n")
    assert load_scenario(file).worlds == {"town": str(tmp_path / "town.usda")}


@pytest.mark.parametrize("count", [1, 3, 7, 20])
def test_parts_are_disjoint_and_complete(count: int) -> None:
    """Every scene is in one part of n; the parts differ by one scene at most."""
    parts = [shard_of(range(2, 15), f"{part}/{count}") for part in range(count)]
    assert sorted(index for part in parts for index in part) == list(range(2, 15))
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


@pytest.mark.parametrize("text", ["", "3", "3/3", "-1/3", "1/0", "a/b", "1/2/3", "0/" + "9" * 5000])
def test_no_such_part(text: str) -> None:
    """Anything else than i/n with i below n is one line."""
    with pytest.raises(InputError, match="--shard"):
        shard_of(range(4), text)


def test_kept_scenario_holds_from_its_folder(tmp_path: Path) -> None:
    """Paths of the scenario that a run keeps lead to the same files, from wherever it is read."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in/stage.usda").write_text("#usda 1.0\n")
    (tmp_path / "s.toml").write_text('[stage]\npath = "in/stage.usda"\nallow_root = ["in"]\n')
    (tmp_path / "deep/out").mkdir(parents=True)
    kept = tmp_path / "deep/out/scenario.toml"
    kept.write_text(load_scenario(tmp_path / "s.toml").as_toml(kept.parent))
    assert str(tmp_path) not in kept.read_text()
    again = load_scenario(kept).stage
    assert again is not None
    assert Path(again.path).resolve() == tmp_path / "in/stage.usda"
    assert [Path(root).resolve() for root in again.allow_root] == [tmp_path / "in"]

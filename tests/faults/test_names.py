"""Names from files reach neither paths outside nor pages but as text; a scene gives away its own files only."""

from __future__ import annotations

import json
import os
import zipfile
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from authoring.exchange.package import package_scene
from authoring.scenes.checkout import checkout_scene
from falsework.report.report import write_report
from falsework.report.survey_page import write_survey_page
from groundwork.errors import InputError
from recon.cloud import Cloud, write_cloud
from recon.formats.export import export_cloud
from tests.falsework.flight_rows import judged_flight
from tests.recon.conftest import poses_on_arc, write_capture
from tests.recon.test_scan import small_cloud
from usd_schemas.guard.guard import check_stage

SCRIPT = '"></div></script><script>alert(1)</script><img src=x onerror=alert(2)>'
HEAD = '#usda 1.0\n(\n    defaultPrim = "A"\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n'
MESH = (
    'def Mesh "A"\n{\n    point3f[] points = [(0,0,0), (1,0,0), (0,1,0)]\n    int[] faceVertexCounts = [3]\n'
    "    int[] faceVertexIndices = [0, 1, 2]\n"
)


def named(*names: str) -> Cloud:
    """Give a cloud whose classes bear these names."""
    cloud = small_cloud()
    given = [*names, *(row.name for row in cloud.classes[len(names) :])]
    rows = (replace(row, name=name) for row, name in zip(cloud.classes, given, strict=False))
    return replace(cloud, classes=tuple(rows))


@pytest.mark.faults
@pytest.mark.parametrize("to", ["s3dis", "pointcept", "ply", "laz"])
def test_class_names_stay_inside_exports(to: str, tmp_path: Path) -> None:
    """Names that climb, are absolute, or alike but for an underscore: nothing lies outside or is lost."""
    source, out = tmp_path / "a/b/cloud", tmp_path / "a/b/out"
    for folder in (source, out):
        folder.mkdir(parents=True)
    names = ["../../../x", "/tmp/x", *(row.name for row in small_cloud().classes[2:])]
    names[9], names[12] = "pier_cap", "piercap"  # the classes of its points
    write_cloud(source, named(*names))
    export_cloud(source, to, out)
    everything = {path for path in tmp_path.rglob("*") if path.is_file()}
    assert {path for path in everything if not path.is_relative_to(source)} == {
        path for path in out.rglob("*") if path.is_file()
    }
    if to == "s3dis":
        rows = [len(path.read_text().splitlines()) for path in out.rglob("Annotations/*.txt")]
        assert sum(rows) == len(small_cloud())


class Tags(HTMLParser):
    """Collects the names of elements, and of attributes that run code."""

    def __init__(self) -> None:
        """Begin with none."""
        super().__init__()
        self.elements: list[str] = []
        self.handlers: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take a start tag down."""
        self.elements.append(tag)
        self.handlers += [name for name, _ in attrs if name.startswith("on")]

    def handle_data(self, data: str) -> None:
        """Take text down."""
        self.text.append(data)


def tags_of(page: Path) -> Tags:
    """Parse a page as a browser would."""
    tags = Tags()
    tags.feed(page.read_text(encoding="utf-8"))
    return tags


@pytest.mark.faults
def test_no_name_becomes_script_in_the_report(tmp_path: Path) -> None:
    """Survey, image, class, scene and statistics named like a script: the page has the elements of an innocent one."""
    pages = []
    for word in ("plain", SCRIPT):
        folder = tmp_path / str(len(pages))
        capture = write_capture(folder / "capture", poses_on_arc(2))
        for file in (capture / "cameras.json", capture / "truth/poses.json"):
            name = word.replace("/", "")
            file.write_text(
                json.dumps(json.loads(file.read_text())).replace('"name": "000000"', f'"name": {json.dumps(name)}')
            )
            for kind, suffix in (("depth", "tiff"), ("semantic", "png"), ("instance", "png")):
                if (old := capture / f"truth/{kind}/000000.{suffix}").exists():
                    old.rename(old.with_name(f"{name}.{suffix}"))
        table = capture / "truth/instances.json"
        table.write_text(table.read_text().replace('"deck"', json.dumps(word)))
        cloud = named(*[word] * 40)
        (folder / "cloud").mkdir()
        cameras = (
            {"name": word.replace("/", ""), "status": "ok", "center_error": 0.1},
            {"name": "b", "status": word, "center_error": 0.1},
        )
        write_cloud(folder / "cloud", replace(cloud, cameras=cameras, statistics={word: word}))
        page = folder / "report.html"
        write_report(page, word, Path("stage") / word.replace("/", ""), {word: (capture, {"": folder / "cloud"})})
        pages.append(page)
    innocent, attacked = (tags_of(page) for page in pages)
    assert attacked.elements == innocent.elements
    assert attacked.handlers == []
    assert any("onerror=alert(2)" in text for text in attacked.text)  # it is there, as text
    assert "<script>alert(1)" not in pages[1].read_text(encoding="utf-8")


@pytest.mark.faults
def test_no_name_becomes_script_in_the_page_of_flights(tmp_path: Path) -> None:
    """The same of a survey and the classes that it covers."""
    pages = []
    for number, word in enumerate(("plain", SCRIPT)):
        pages.append(tmp_path / f"{number}.html")
        write_survey_page(pages[-1], [judged_flight(word)], word)
    innocent, attacked = (tags_of(page) for page in pages)
    assert attacked.elements == innocent.elements
    assert attacked.handlers == []


def refused(stage: Path) -> str:
    """Check a stage that does not pass."""
    with pytest.raises(InputError) as caught:
        check_stage(stage, (), print)
    return str(caught.value)


@pytest.mark.faults
@pytest.mark.parametrize(
    "inner",
    [
        'def "A" (\n    references = @{}@</A>\n)\n{{\n}}\n',
        'def "A"\n{{\n    asset file = @{}@\n}}\n',
        'def "A" (\n    prepend variantSets = "v"\n)\n{{\n    variantSet "v" = {{\n        "w" (\n'
        "            references = @{}@</A>\n        ) {{\n        }}\n    }}\n}}\n",
    ],
)
@pytest.mark.parametrize("how", ["absolute", "../../out.usda", "http", "in the folder of the command", "nested"])
def test_nothing_inside_a_package_leads_out(
    inner: str, how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A layer deep in a usdz, in an arc or a texture, absolute, climbing, remote, or found where the command runs."""
    (tmp_path / "out.usda").write_text(HEAD + MESH + "}\n")
    monkeypatch.chdir(tmp_path)
    places = {
        "absolute": str(tmp_path / "out.usda"),
        "nested": str(tmp_path / "out.usda"),
        "http": "http:" + "//nowhere/out.usda",
        "in the folder of the command": "out.usda",
    }
    name = places.get(how, how)
    package = tmp_path / "scene/tile.usdz"
    package.parent.mkdir()
    with zipfile.ZipFile(package, "w") as archive:
        if how == "nested":
            with zipfile.ZipFile(tmp_path / "inner.usdz", "w") as nested:
                nested.writestr("deep.usda", HEAD + inner.format(name))
            archive.writestr("root.usda", HEAD + 'def "A" (\n    references = @./inner.usdz@</A>\n)\n{\n}\n')
            archive.write(tmp_path / "inner.usdz", "inner.usdz")
        else:
            archive.writestr("root.usda", HEAD + 'def "A" (\n    references = @./in/layer.usda@</A>\n)\n{\n}\n')
            archive.writestr("in/layer.usda", HEAD + inner.format(name))
    assert f"{name} leads out of the package" in refused(package)
    holder = tmp_path / "scene/scene.usda"
    layer = "root.usda" if how == "nested" else "in/layer.usda"
    holder.write_text(HEAD + f'def "A" (\n    references = @./tile.usdz[{layer}]@</A>\n)\n{{\n}}\n')
    assert f"{name} leads out of the package" in refused(holder)


@pytest.mark.faults
def test_a_file_is_not_taken_from_where_the_command_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """USD looks for a name without ./ in the working folder, too; a missing layer is not replaced by a private one."""
    (tmp_path / "out.usda").write_text(HEAD + MESH + "}\n")
    stage = tmp_path / "scene/scene.usda"
    stage.parent.mkdir()
    stage.write_text(HEAD + 'def "A" (\n    references = @out.usda@</A>\n)\n{\n}\n')
    monkeypatch.chdir(tmp_path)
    assert "out.usda is not there, and USD would read it from" in refused(stage)
    monkeypatch.chdir(stage.parent)
    said: list[str] = []
    check_stage(stage, (), said.append)
    assert ["there is no file out.usda" in line for line in said] == [True]


@pytest.mark.faults
def test_a_pipe_in_a_stage_is_refused(tmp_path: Path) -> None:
    """A layer or a texture that is a pipe would be waited for without end."""
    for number, inner in enumerate(
        ('def "A" (\n    references = @./x.usda@\n)\n{\n}\n', 'def "A"\n{\n    asset f = @./x.usda@\n}\n')
    ):
        stage = tmp_path / str(number) / "scene.usda"
        stage.parent.mkdir()
        stage.write_text(HEAD + inner)
        os.mkfifo(stage.parent / "x.usda")
        assert "is a pipe or a device" in refused(stage)


@pytest.mark.faults
def test_a_checkout_takes_the_scenes_own_files_only(tmp_path: Path) -> None:
    """Layers, textures, variants and what the manifest lists; not a key that lies there, and nothing through a link."""
    home, secret = tmp_path / "scene", tmp_path / "secret.png"
    (home / "textures").mkdir(parents=True)
    secret.write_bytes(b"secret")
    (home / "private.key").write_text("secret")
    (home / "diary.txt").symlink_to(secret)
    (home / "textures/a.png").write_bytes(b"a")
    (home / "notes.md").write_text("notes")
    (home / "scene.usda").write_text(HEAD + MESH + "    asset f = @./textures/a.png@\n}\n")
    (home / "variant_b.usda").write_text("#usda 1.0\n(\n    subLayers = [@./scene.usda@]\n)\n")
    listed = ["notes.md", "diary.txt", "private.key", "../secret.png"]
    (home / "manifest.json").write_text(json.dumps({"files": dict.fromkeys(listed, "0")}))
    root = checkout_scene(home, tmp_path / "mine")
    copied = {path.relative_to(root.parent).as_posix() for path in root.parent.rglob("*") if path.is_file()}
    assert copied == {"scene.usda", "textures/a.png", "variant_b.usda", "manifest.json", "notes.md"}
    (home / "textures/a.png").unlink()
    (home / "textures/a.png").symlink_to(secret)
    for copy in (
        lambda: checkout_scene(home, tmp_path / "other"),
        lambda: package_scene(home / "scene.usda", tmp_path / "x.usdz"),
    ):
        with pytest.raises(InputError, match=r"textures/a\.png leads out of the allowed folders"):
            copy()
    assert not (tmp_path / "other").exists()

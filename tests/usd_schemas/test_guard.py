"""Stages from elsewhere: what leads outside, in a circle or beyond all measure is refused by name, in time."""

import shlex
import time
from pathlib import Path
from typing import Any

import pytest
from pxr import Usd, UsdGeom, Vt

from falsework.children.products import surveys_of
from groundwork.errors import ChildError, InputError, MissingError
from groundwork.progress import Progress
from tests.conftest import RecordProof
from usd_schemas.guard.guard import check_stage
from usd_schemas.reading.stage_reader import read_stage

HUGE = 120_000_000  # integers, 0.48 GB
HEAD = '#usda 1.0\n(\n    defaultPrim = "A"\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n'
MESH = (
    'def Mesh "A"\n{\n    point3f[] points = [(0,0,0), (1,0,0), (0,1,0)]\n    int[] faceVertexCounts = [3]\n'
    "    int[] faceVertexIndices = [0, 1, 2]\n}\n"
)


def write(path: Path, text: str) -> Path:
    """Write a layer below the usual head."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text if text.startswith("#usda") else HEAD + text, encoding="utf-8")
    return path


def warnings(path: Path, *roots: Path) -> list[str]:
    """Check a stage that passes."""
    said: dict[str, None] = {}
    check_stage(path, roots, said.setdefault)
    return list(said)


def refusal(path: Path, *roots: Path) -> str:
    """Check a stage that does not pass."""
    with pytest.raises(InputError) as error:
        check_stage(path, roots, print)
    assert "\n" not in str(error.value)
    return str(error.value)


ESCAPES = {
    "reference": 'def "A" (\n    references = @{}@</A>\n)\n{{\n}}\n',
    "payload": 'def "A" (\n    payload = @{}@</A>\n)\n{{\n}}\n',
    "texture": 'def "A"\n{{\n    asset file = @{}@\n}}\n',
    "moving texture": 'def "A"\n{{\n    asset file.timeSamples = {{\n        1: @{}@,\n    }}\n}}\n',
    "textures": 'def "A"\n{{\n    asset[] files = [@{}@]\n}}\n',
    "clip": 'def "A" (\n    clips = {{\n        dictionary default = {{\n            asset[] assetPaths = [@{}@]\n'
    "        }}\n    }}\n)\n{{\n}}\n",
    "unselected variant": 'def "A" (\n    prepend variantSets = "v"\n)\n{{\n    variantSet "v" = {{\n        "w" (\n'
    "            references = @{}@</A>\n        ) {{\n        }}\n    }}\n}}\n",
    "expression": 'def "A" (\n    payload = @`"{}"`@</A>\n)\n{{\n}}\n',
}


OUTSIDE = (
    "../out.usda",
    "absolute",
    *(f"{scheme}://bucket/out.usda" for scheme in ("http", "s3")),
    "./in/../../out.usda",
)


def test_what_leads_outside_is_refused(tmp_path: Path, record_proof: RecordProof) -> None:
    """Every way to name a file, in whatever arc or variant: the line names layer, prim and path."""
    refused = below = 0
    for number, (kind, how) in enumerate((kind, how) for kind in ESCAPES for how in OUTSIDE):
        place = tmp_path / str(number)
        outside = write(place / "out.usda", MESH)
        name = str(outside) if how == "absolute" else how
        text = refusal(write(place / "scene/scene.usda", ESCAPES[kind].format(name)))
        assert name in text, (kind, how)
        assert "./scene.usda: /A" in text, (kind, how)
        refused += 1
        if "://" not in name:
            write(place / "scene/in/x.usda", MESH)
            assert warnings(place / "scene/scene.usda", place) == [], (kind, how)
            below += 1
    record_proof(
        "stage/guard: escapes are refused with layer, prim and path", refused, 0, {"allowed_by_a_higher_root": below}
    )


def test_sublayers_and_inner_layers_count_too(tmp_path: Path) -> None:
    """A layer that is only reached through another one is looked through as well, and a link is what it points to."""
    write(tmp_path / "out.usda", MESH)
    scene = write(tmp_path / "s/scene.usda", "#usda 1.0\n(\n    subLayers = [@./a/one.usda@]\n)\n")
    write(tmp_path / "s/a/one.usda", 'def "A" (\n    references = @./two.usda@\n)\n{\n}\n')
    write(tmp_path / "s/a/two.usda", '#usda 1.0\n(\n    defaultPrim = "A"\n    subLayers = [@../../out.usda@]\n)\n')
    assert "./a/two.usda: ../../out.usda leads out" in refusal(scene)
    (tmp_path / "s/a/two.usda").unlink()
    (tmp_path / "s/a/two.usda").symlink_to(tmp_path / "out.usda")
    assert "./a/one.usda: /A: ./two.usda leads out" in refusal(scene)
    assert warnings(scene, tmp_path) == []


def test_circles_are_named(tmp_path: Path, record_proof: RecordProof) -> None:
    """Arcs that come back to their start, over one layer or three, and sublayers of themselves."""
    inner = 'def "B" (\n        references = </A>\n    )\n    {\n    }\n'
    own = write(tmp_path / "own.usda", f'def "A" (\n    references = </A/B>\n)\n{{\n    {inner}}}\n')
    told = [refusal(own)]
    assert "./own.usda: /A" in told[0]
    for name, other in (("a", "b"), ("b", "c"), ("c", "a")):
        write(
            tmp_path / f"{name}.usda",
            f'def "A"\n{{\n    def "X" (\n        payload = @./{other}.usda@\n    )\n    {{\n    }}\n}}\n',
        )
    told.append(refusal(tmp_path / "a.usda"))
    assert "references form a cycle" in told[1]
    stacked = write(tmp_path / "stacked.usda", "#usda 1.0\n(\n    subLayers = [@./stacked.usda@]\n)\n")
    told.append(refusal(stacked))
    assert "sublayer of itself" in told[2]
    longest = max(len(text) for text in told)
    record_proof("stage/guard: circles are refused by name", len(told), 0, {"longest_message_characters": longest})


def bomb(path: Path, levels: int) -> Path:
    """Write a file in which each prim brings in the next one twice."""
    rows = [
        f'def "L{row}"\n{{\n'
        + "".join(f'def "{side}" (\nreferences = </L{row + 1}>\n)\n{{\n}}\n' for side in "ab")
        + "}\n"
        for row in range(levels)
    ]
    return write(path, '#usda 1.0\n(\ndefaultPrim = "L0"\n)\n' + "".join(rows) + f'def Xform "L{levels}"\n{{\n}}\n')


@pytest.mark.parametrize("instanceable", [False, True])
def test_nested_references_are_counted_before_they_are_composed(
    instanceable: bool, tmp_path: Path, record_proof: RecordProof
) -> None:
    """3 kB that stand for two million prims are refused before they are composed; 2^9 of them pass."""
    file = bomb(tmp_path / "bomb.usda", 20)
    if instanceable:
        text = file.read_text(encoding="utf-8").replace("references =", "instanceable = true\nreferences =")
        file.write_text(text, encoding="utf-8")
    assert file.stat().st_size < 4000
    begin = time.process_time()
    assert "more than 1000000 prims" in refusal(file)
    seconds = time.process_time() - begin
    assert seconds < 20.0  # a second or less; composing them all takes minutes on any machine
    kind = "instances" if instanceable else "references"
    record_proof(f"stage/guard: 2^20 nested {kind} are refused", 2**20, 0, {"cpu_s": seconds})
    assert warnings(bomb(tmp_path / "small.usda", 9)) == []


def test_bomb_through_the_door(tmp_path: Path) -> None:
    """What the command line calls ends in the same line, naming file and prim."""
    with pytest.raises(InputError, match=r"bomb.usda: /L\d+: composes to more than"):
        surveys_of(bomb(tmp_path / "bomb.usda", 20))


def test_huge_instancers_are_refused(tmp_path: Path) -> None:
    """Equal values compress to almost nothing: a small file that draws twelve million copies is named."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "huge.usdc"))
    instancer = UsdGeom.PointInstancer.Define(stage, "/A")
    instancer.CreateProtoIndicesAttr(Vt.IntArray(12_000_000, 0))
    stage.Save()
    assert (tmp_path / "huge.usdc").stat().st_size < 1_000_000
    assert "/A: draws more than 10000000 instances" in refusal(tmp_path / "huge.usdc")


def test_huge_arrays_end_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record_proof: RecordProof
) -> None:
    """A file of some hundred kilobytes whose one array fills more memory than there may be."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "huge.usdc"))
    mesh = UsdGeom.Mesh.Define(stage, "/A")
    mesh.CreatePointsAttr([(0, 0, 0)] * 3)
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray(HUGE, 0))
    stage.Save()
    del stage, mesh
    size = (tmp_path / "huge.usdc").stat().st_size
    assert size < 1_000_000
    monkeypatch.setattr("falsework.children.products.MEMORY_LIMIT", 0.6)
    with pytest.raises(InputError, match=r"huge.usdc: .*memory"):
        surveys_of(tmp_path / "huge.usdc")
    record_proof("stage/guard: a huge array ends in one line", HUGE, 0, {"file_bytes": size})


def test_whatever_kills_the_child_is_the_fault_of_the_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Over the limits, reading ends in one line that names the stage."""
    scene = write(tmp_path / "scene.usda", MESH)
    assert len(surveys_of(scene)) == 1
    monkeypatch.setattr("falsework.children.products.MEMORY_LIMIT", 0.01)
    with pytest.raises(InputError, match=r"scene.usda: cannot be read .* it used more than 0.0 GB of memory"):
        surveys_of(scene)
    monkeypatch.setattr("falsework.children.products.MEMORY_LIMIT", 4.0)
    monkeypatch.setattr("falsework.children.products.TIME_LIMIT", 0.1)
    with pytest.raises(InputError, match=r"scene.usda: cannot be read within 0 s and 4 GB: stopped because it ran"):
        surveys_of(scene)


@pytest.mark.parametrize(
    ("said", "signal", "line"),
    [
        ("died of SIGSEGV: it printed nothing", "SIGSEGV", "died of SIGSEGV: it printed nothing. Save it again"),
        ("died of SIGKILL: it printed nothing", "SIGKILL", "died of SIGKILL: .* Something else ended it"),
        ("failed with exit code 1: MemoryError", "", "failed with exit code 1: MemoryError. Save it again"),
    ],
)
def test_a_limit_is_named_only_where_the_child_was_stopped_at_it(
    said: str, signal: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A crash is called what it was."""

    def crash(module: str, *_: Any, **__: Any) -> None:
        raise ChildError(f"{module}: {said}", signal=signal)

    monkeypatch.setattr("falsework.children.products.run_child", crash)
    begin = "scene.usda: cannot be read: the process that reads it "
    with pytest.raises(InputError, match=begin + line) as caught:
        surveys_of(write(tmp_path / "scene.usda", MESH))
    assert " GB" not in str(caught.value)


def test_what_the_child_explains_is_said_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error with a colon is no crash of a module of that name."""

    def explain(*_: Any, **__: Any) -> None:
        raise ChildError("the schemas of USD: two versions are installed")

    monkeypatch.setattr("falsework.children.products.run_child", explain)
    with pytest.raises(InputError, match=r"cannot be read: the schemas of USD: two versions are installed$"):
        surveys_of(write(tmp_path / "scene.usda", MESH))


def test_odd_things_are_warned_of(tmp_path: Path, record_proof: RecordProof) -> None:
    """Missing files, types without a schema, unknown variants and other units, each with layer or prim."""
    write(
        tmp_path / "cm.usda",
        '#usda 1.0\n(\n    defaultPrim = "A"\n    metersPerUnit = 0.01\n    upAxis = "Y"\n)\n' + MESH,
    )
    scene = write(
        tmp_path / "scene.usda",
        'def Xform "A" (\n    prepend variantSets = "v"\n    variants = {\n        string v = "moon"\n    }\n)\n{\n'
        '    variantSet "v" = {\n        "sun" {\n        }\n    }\n    asset file = @./gone.png@\n'
        '    def Truss "T"\n    {\n    }\n    def "U" (\n        references = @./cm.usda@\n    )\n    {\n    }\n}\n',
    )
    said = "\n".join(warnings(scene))
    assert "./scene.usda: /A: there is no file ./gone.png" in said
    assert "/A/T: type Truss needs a schema plugin" in said
    assert "/A: variant set v has no variant 'moon'; it has sun" in said
    assert "/A/U references ./cm.usda, whose metersPerUnit is 0.01, not 1.0" in said
    assert "upAxis is Y" in said
    assert len(said.splitlines()) == 5
    name = "stage/guard: missing texture, untyped prim, unknown variant, other unit and up axis are named"
    record_proof(name, 5, 0, {"lines": len(said.splitlines())})


def test_warnings_reach_the_user(tmp_path: Path) -> None:
    """The child's warnings come out of the door."""
    scene = write(tmp_path / "scene.usda", MESH.replace("}\n", "    asset file = @./gone.png@\n}\n"))
    notes: list[str] = []

    class Listener:
        """Keeps notes."""

        def stage(self, name: str, total: int) -> None:
            """Ignore it."""

        def advance(self, done: int) -> None:
            """Ignore it."""

        def note(self, message: str) -> None:
            """Keep it."""
            notes.append(message)

    listener: Progress = Listener()
    assert len(surveys_of(scene, progress=listener)) == 1
    assert notes == ["./scene.usda: /A: there is no file ./gone.png"]


def test_files_that_are_no_stage(tmp_path: Path) -> None:
    """Missing and broken files are bad input, with their name."""
    with pytest.raises(MissingError):
        check_stage(tmp_path / "none.usda", (), print)
    assert "broken.usda: not readable as USD" in refusal(write(tmp_path / "broken.usda", "#usda 1.0\ndef {"))
    (tmp_path / "cut.usdc").write_bytes(b"PXR-USDC" + bytes(20))
    assert "cut.usdc: not readable as USD" in refusal(tmp_path / "cut.usdc")


@pytest.mark.parametrize(
    ("text", "line", "cause"),
    [
        ("def {", 7, "expected"),
        ('def "A"\n{\n    point3f[] points = [(0, 0, 0)\n}\n', 10, "expected ListValueClose at '}'"),
    ],
)
def test_what_cannot_be_parsed_is_named_with_line_and_cause(
    tmp_path: Path, text: str, line: int, cause: str, record_proof: RecordProof
) -> None:
    """A text file that breaks off says in which line, and what was expected there, wherever it is read."""
    path = write(tmp_path / "broken.usda", text)
    said = [refusal(path)]
    with pytest.raises(InputError) as error:
        read_stage(path)
    for words in (*said, str(error.value)):
        assert f"line {line}, column " in words
        assert cause in words
        assert "pxrInternal" not in words
    record_proof(f"parse errors: line and cause, line {line}", 2, 0, {"named": sum(cause in words for words in said)})


def test_a_refused_path_says_which_words_would_allow_it(tmp_path: Path, record_proof: RecordProof) -> None:
    """The words that the refusal of `../` prints are those with which the stage is read."""
    write(tmp_path / "lib o" / "a.usda", MESH)
    path = write(tmp_path / "shot" / "scene.usda", 'def "A" (\n    references = @../lib o/a.usda@</A>\n)\n{\n}\n')
    words = shlex.split(refusal(path).partition("or add ")[2])
    assert words[0] == "--allow-root"
    assert Path(words[1]) == tmp_path
    said = warnings(path, Path(words[1]))
    assert said == []
    record_proof("refused ../: the words that would allow it", 1, 0, {"lines_with_them": len(said)})

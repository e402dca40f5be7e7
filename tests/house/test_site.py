"""The reference of the scenario by topic: nothing stands nowhere, and nothing twice."""

import re
from pathlib import Path

from docs.scenario_pages import TOPICS, topic_of
from docs.settings_table import kind_of, sections
from falsework.scenario import Scenario

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_every_section_stands_on_one_page() -> None:
    """Each section has one topic, whose page has its heading once."""
    for section, model in sections(Scenario):
        (topic,) = topic_of(section)
        kind = kind_of(model)
        head = f'`[[{section}]]` with `kind = "{kind}"`' if kind else f"`[{section}]`" if section else "Top level"
        page = (DOCS / f"scenario/{topic}.md").read_text(encoding="utf-8")
        rows = [key for key in model.model_fields if f"| `{key}` |" in page]
        assert page.count(f"\n## {head}\n") == int(bool(rows)), (section, topic)
    assert {topic_of(section)[0] for section, _ in sections(Scenario)} == set(TOPICS)


def test_every_page_has_its_place() -> None:
    """Each page and each benchmark is named in an index, so that the site's warnings never come as a surprise."""
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^([\w/]+)$", index, re.M))
    pages = {
        path.relative_to(DOCS).with_suffix("").as_posix() for path in [*DOCS.glob("*.md"), *DOCS.glob("howto/*.md")]
    }
    assert pages - {"index"} - listed == set()
    benchmarks = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    measured = {
        path.relative_to(DOCS).as_posix() for path in [*DOCS.glob("benchmarks/*.md"), *DOCS.glob("experiments/*.md")]
    }
    assert {page for page in measured if f"({page})" not in benchmarks} == set()


def test_every_cell_about_others_says_where_it_was_read() -> None:
    """In the README's comparison a cell is a dash or leads to its source, of others at the commit that was read."""
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8").partition("## Beside others")[2]
    ours, *others = [line for line in text.partition("\n## ")[0].splitlines() if line.startswith("| ")][1:]
    assert len(others) >= 6
    for cell in re.findall(r"\]\(([^)]+)\)", ours):
        assert (DOCS.parent / cell).is_file(), cell
    for line in others:
        for cell in line.strip("| ").split(" | ")[1:]:
            links = re.findall(r"\]\((https://github\.com/[\w-]+/[\w-]+/(?:blob|tree)/[0-9a-f]{7,}/[^) ]+)\)", cell)
            assert cell == "–" or links, (line[:40], cell)


def test_code_blocks_stand_on_lines_of_their_own() -> None:
    """A fence within a line of text is what a paragraph that was wrapped anew leaves of a block."""
    pages = [*DOCS.rglob("*.md"), *DOCS.parent.glob("*.md")]
    for page in pages:
        lines = page.read_text(encoding="utf-8").splitlines()
        fences = [line for line in lines if "```" in line]
        assert [line for line in fences if not re.fullmatch(r" *```([a-z]*|\{.*)", line)] == [], page
        assert len(fences) % 2 == 0, page

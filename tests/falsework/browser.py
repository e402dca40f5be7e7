"""A Chromium without a window and with WebGL in software: what a page says of itself, and what its console said."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from tests.patience import left

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FOUND = "found in the page"
WORDS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # which software does twice as slowly as no GPU at all
    "--enable-logging=stderr",
    "--disable-extensions",
    "--disable-background-networking",
    "--no-first-run",
)


@dataclass(frozen=True)
class Answer:
    """What came of opening a page.

    Attributes:
        told: What the page was asked to say, or None.
        console: Lines of its console.
        dom: The page as it stands in the end.
    """

    told: Any
    console: list[str]
    dom: str


@cache
def chromium() -> str:
    """Give the path of a Chromium that starts, or an empty string; a stub that would install one does not count."""
    for name in NAMES:
        path = shutil.which(name)
        if path is not None:
            try:
                done = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=20, check=False)
            except (OSError, subprocess.TimeoutExpired):
                continue
            if done.returncode == 0 and "Chrom" in done.stdout:
                return path
    return ""


needs_browser = pytest.mark.skipif(
    not chromium(), reason="no Chromium that starts: apt-get install chromium, or bootstrap/system_libraries.py browser"
)


def open_page(page: Path, script: str = "", budget: int = 20_000, *flags: str) -> Answer:
    """Open a page, and have a script say something about it.

    Args:
        page: HTML file.
        script: Body of an async function that returns JSON; the page that it is asked in is a copy without the policy
            that keeps strangers' scripts out. Empty: the page itself is opened as it is.
        budget: Virtual time that it may take [ms].
        flags: Further words for the browser.
    """
    if script:
        text = page.read_text(encoding="utf-8")
        begin = text.index('<meta http-equiv="Content-Security-Policy"')
        text = text[:begin] + text[text.index(">", begin) + 1 :]
        say = f'(told) => {{ document.body.textContent = "{FOUND}" + JSON.stringify(told) + "{FOUND}"; }}'
        failed = "(mistake) => ({ mistake: String(mistake && mistake.stack) })"
        ask = f"<script>(async () => {{ {script} }})().catch({failed}).then({say});</script>"
        page = page.with_name(f"asked-{page.name}")
        page.write_text(text.replace("</body>", ask + "</body>"), encoding="utf-8")
    profile = page.parent / "profile"
    words = [chromium(), *WORDS, f"--user-data-dir={profile}", f"--virtual-time-budget={budget}", *flags, "--dump-dom"]
    done = subprocess.run([*words, page.as_uri()], capture_output=True, text=True, check=True, timeout=left())
    told = json.loads(unescape(done.stdout.split(FOUND)[1])) if script else None
    if script and isinstance(told, dict) and "mistake" in told:
        raise AssertionError(told["mistake"])
    return Answer(told, [line for line in done.stderr.splitlines() if ":CONSOLE" in line], done.stdout)

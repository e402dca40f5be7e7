"""Notebooks out of tested scripts: `# %%` begins a cell, `# %% [markdown]` one of text; the docstring comes first."""

import ast
import json
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parent / "notebooks"
SCRIPTS = ("author_and_swap", "render_and_reconstruct", "train_and_predict")
_MARK, _TEXT = "# %%", "# %% [markdown]"


@dataclass(frozen=True)
class Cell:
    """One cell.

    Attributes:
        is_code: Python; else Markdown.
        text: Its source, without a newline at the end.
    """

    is_code: bool
    text: str


def cells(script: str) -> list[Cell]:
    """Cut a script into cells.

    Args:
        script: Source text.
    """
    title, _, about = (ast.get_docstring(ast.parse(script)) or "").partition("\n\n")
    found = [Cell(False, f"# {title.rstrip('.')}\n\n{about}")]
    for part in script.split(f"\n{_MARK}")[1:]:
        head, _, body = part.partition("\n")
        if f"{_MARK}{head}" == _TEXT:
            found.append(
                Cell(False, "\n".join(line.removeprefix("#").removeprefix(" ") for line in body.splitlines()).strip())
            )
        else:
            found.append(Cell(True, body.strip()))
    return found


def notebook(name: str) -> str:
    """Write a notebook, without outputs, in Jupyter's format.

    Args:
        name: One of `SCRIPTS`.
    """
    made = []
    for number, cell in enumerate(_cells_of(name)):
        lines = cell.text.splitlines(keepends=True)
        one = {"id": f"cell-{number}", "metadata": {}, "source": lines}
        code = {"cell_type": "code", "execution_count": None, "outputs": []}
        made.append({**(code if cell.is_code else {"cell_type": "markdown"}), **one})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {
        "cells": made,
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(whole, indent=1, ensure_ascii=False, sort_keys=True) + "\n"


def notebook_page(name: str) -> str:
    """Write the same as a page of the site.

    Args:
        name: One of `SCRIPTS`.
    """
    first, *others = _cells_of(name)
    origin = f"[The notebook]({name}.ipynb), made of `docs/notebooks/{name}.py` by `python -m docs.generate`."
    parts = [first.text, origin]
    parts += [f"```python\n{cell.text}\n```" if cell.is_code else cell.text for cell in others]
    return "\n\n".join(parts) + "\n"


def _cells_of(name: str) -> list[Cell]:
    return cells((FOLDER / f"{name}.py").read_text(encoding="utf-8"))

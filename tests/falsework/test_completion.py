"""What a shell offers on Tab, asked of a real shell."""

import subprocess
from pathlib import Path

import pytest

from falsework.cli import all_verbs, main

# A line of words as bash has them when Tab is pressed: the last one is being typed.
ASK = """
source "$1"
while read -r line; do
  IFS='|' read -r -a COMP_WORDS <<< "$line."
  last=$((${#COMP_WORDS[@]} - 1))
  COMP_WORDS[last]="${COMP_WORDS[last]%.}"
  COMP_CWORD=$last COMP_LINE="${COMP_WORDS[*]}" COMPREPLY=()
  COMP_POINT=${#COMP_LINE}
  "$(complete -p falsework | sed 's/.*-F \\([^ ]*\\) .*/\\1/')"
  echo "${COMPREPLY[*]}"
done
"""


def test_bash_completes_verbs_options_and_choices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every verb after its first words, an option after its first letters, every choice of an option."""
    with pytest.raises(SystemExit) as left:
        main(["completion", "bash"])
    assert not left.value.code
    script = tmp_path / "falsework.bash"
    script.write_text(capsys.readouterr().out)
    verbs = all_verbs()
    heads = sorted({name.split()[0] for name in verbs})
    scene = sorted(name.split()[1] for name in verbs if name.startswith("scene "))
    asked = {
        "falsework|": [*heads, "--help", "-h"],
        "falsework|scene|": [*scene, "--help", "-h"],
        "falsework|run|x.toml|--wo": ["--workers"],
        "falsework|export|cloud|--to|co": ["colmap"],
        "falsework|nobody": [],
    }
    done = subprocess.run(
        ["bash", "-c", ASK, "bash", str(script)],
        input="\n".join(asked) + "\n",
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    offered = [sorted(line.split()) for line in done.stdout.splitlines()]
    assert offered == [sorted(words) for words in asked.values()]


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_get_a_script_of_every_verb(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each verb's last word stands in it; another shell is refused in the parser's own words."""
    with pytest.raises(SystemExit) as left:
        main(["completion", shell])
    assert not left.value.code
    script = capsys.readouterr().out
    assert [name for name in all_verbs() if name.split()[-1] not in script] == []
    with pytest.raises(SystemExit) as refused:
        main(["completion", "tcsh"])
    assert refused.value.code == 2

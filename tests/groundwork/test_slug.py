"""Names from files as names of files: plain, all different, and inside."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundwork.errors import InputError
from groundwork.slug import flat_names, inside, slug

ANY = st.text(alphabet=st.characters(codec=None), max_size=300)
ALLOWED = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-")


@given(ANY)
def test_a_slug_is_a_plain_name(name: str) -> None:
    """Whatever the text: letters, digits and three signs, at most 80, beginning with a letter or digit; done once."""
    plain = slug(name)
    assert set(plain) <= ALLOWED
    assert 0 < len(plain) <= 80
    assert plain[0].isalnum()
    assert slug(plain) == plain


@given(ANY, ANY)
def test_two_names_stay_two(one: str, other: str) -> None:
    """What differs goes on to differ, in case only, by signs that are left out, or by length."""
    assert (slug(one) == slug(other)) == (one == other)


@pytest.mark.parametrize("name", ["deck", "pier_cap", "Area_1", "a.b-c", "0000"])
def test_plain_names_stay(name: str) -> None:
    """What is plain already is not touched."""
    assert slug(name) == name


@pytest.mark.parametrize("name", ["../x", "/etc/hostname", "a/../../x", "..", ".", "", "a\0b", "x" * 5000, "link/x"])
def test_nothing_leads_out(name: str, tmp_path: Path) -> None:
    """Climbing, absolute, empty, nameless, too long, or through a link: refused; the slug of it is inside."""
    home = tmp_path / "home"
    home.mkdir()
    (home / "link").symlink_to(tmp_path)
    with pytest.raises(InputError, match="leads out of its folder"):
        inside(home, name)
    assert inside(home, slug(name)).parent == home


def test_photographs_in_folders_get_names_of_one_folder() -> None:
    """`images/` goes and slashes become underscores; a name twice is refused, a long one is made plain."""
    assert flat_names(["images/a.jpg", "b/c d.jpg"]) == {"images/a.jpg": "a.jpg", "b/c d.jpg": "b_c d.jpg"}
    long = flat_names(["x" * 300 + ".jpg"])["x" * 300 + ".jpg"]
    assert long.endswith(".jpg")
    assert len(long) < 100
    with pytest.raises(InputError, match=r"the same name \(found 'a_b.jpg'\)"):
        flat_names(["a/b.jpg", "a_b.jpg"])

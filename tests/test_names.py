"""Laws of names that come from anywhere."""

from __future__ import annotations

import os
import string

import pytest

from mpgrasp.exceptions import AssetError
from mpgrasp.names import MAX_NAME, RESERVED, check_name, printable, safe_name

NASTY = (
    "", " ", "world", "basket", "a/b", "../x", "x" * 300, "\x1b[31mred", "a\nb", "a\tb", "\x00", "\u202eabc",
    os.fsdecode(b"\xff\xfe"), "\ud800",
)  # fmt: skip
NICE = ("usb_stick", "[m]", "[bold]x", "a|b", "<b>x", "-x", "ü", "Ж", "名", "a b", "x" * MAX_NAME)


@pytest.mark.parametrize("name", NASTY)
def test_what_no_object_may_be_called_is_refused_in_words_that_can_be_printed(name: str) -> None:
    with pytest.raises(AssetError, match="name of an object") as caught:
        check_name(name)
    str(caught.value).encode("utf-8")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("name", NICE)
def test_any_other_name_is_taken(name: str) -> None:
    check_name(name)


@pytest.mark.parametrize("name", [*NASTY, *NICE])
def test_every_file_s_name_has_a_safe_one_which_is_its_own(name: str) -> None:
    safe = safe_name(name)
    check_name(safe)
    assert safe_name(safe) == safe


def test_safe_names_keep_what_can_be_kept() -> None:
    assert safe_name("toy car (2)") == "toy_car_(2)"
    assert safe_name("[m]") == "[m]"
    assert all(safe_name(name) not in RESERVED for name in RESERVED)


def test_printable_leaves_what_is_seen_and_escapes_what_a_terminal_obeys() -> None:
    seen = string.ascii_letters + string.digits + string.punctuation + " üЖ名"
    assert printable(seen) == seen
    assert printable("\x1b[31m\n\x07") == "\\x1b[31m\\n\\x07"
    assert printable(os.fsdecode(b"\xff")) == "\\udcff"

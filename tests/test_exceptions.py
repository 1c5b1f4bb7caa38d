from __future__ import annotations

import pickle

import pytest

from mpgrasp import exceptions
from mpgrasp.exceptions import ConfigError, MpgraspError

FAMILY = [
    item for item in vars(exceptions).values() if isinstance(item, type) and issubclass(item, MpgraspError)
]


def test_an_error_says_what_is_wrong_what_was_got_and_what_is_allowed() -> None:
    assert (
        str(ConfigError("unknown suite", got="x", allowed=["a", "b"]))
        == "unknown suite; got 'x'; allowed: a, b"
    )
    assert str(ConfigError("too few", allowed="1 or more")) == "too few; allowed: 1 or more"
    assert str(ConfigError("bad")) == "bad"


def test_falsy_values_are_shown_too() -> None:
    assert str(ConfigError("n", got=0)) == "n; got 0"
    assert str(ConfigError("n", got="")) == "n; got ''"


@pytest.mark.parametrize("kind", FAMILY)
def test_every_error_is_caught_as_mpgrasp_error_and_survives_the_way_between_processes(
    kind: type[MpgraspError],
) -> None:
    error = kind("wrong", got=1, allowed="2")
    copy = pickle.loads(pickle.dumps(error))
    assert isinstance(error, MpgraspError)
    assert type(copy) is kind
    assert str(copy) == str(error)


def test_config_errors_are_value_errors() -> None:
    assert issubclass(ConfigError, ValueError)


def test_an_error_raised_again_keeps_its_words() -> None:
    """As gymnasium's vector environments do with the errors of their processes: class(error)."""
    error = ConfigError("unknown suite", got="x", allowed=("a", "b"))
    assert str(type(error)(error)) == str(error)

"""What is streamed to a viewer is what a recording has."""

from __future__ import annotations

import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.recording.live_rerun import LiveRerun


def test_an_address_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"no viewer of rerun .*; got 'nowhere'; allowed: rerun\+http"):
        LiveRerun("nowhere")

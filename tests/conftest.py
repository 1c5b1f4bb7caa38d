"""Fixtures that tests of several rooms share."""

from __future__ import annotations

import fakes
import pytest


@pytest.fixture
def fake_world(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Episodes and world card that take no time."""
    monkeypatch.setattr("mpgrasp.episode.episode.run_episode", fakes.run_episode)
    monkeypatch.setattr(
        "mpgrasp.bench.playing.world_card.world_card", lambda *_: {"physics": {}, "camera": {}}
    )
    return monkeypatch

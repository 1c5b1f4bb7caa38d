"""Fixtures that tests of several rooms share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import fakes
import pytest


@pytest.fixture
def fake_world(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Episodes and world card that take no time."""
    monkeypatch.setattr("mpgrasp.episode.episode.run_episode", fakes.run_episode)
    monkeypatch.setattr("mpgrasp.bench.playing.world_card.world_card", lambda *_: fakes.WORLD)
    return monkeypatch


@pytest.fixture(scope="session")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a tiny training set, which nobody changes."""
    from toy_shards import write_shards

    return write_shards(tmp_path_factory.mktemp("shards"), shards=2, images=40)


@pytest.fixture(scope="module")
def network_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Cache that keeps the networks which a module's tests compile, in place of the user's."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MPGRASP_CACHE", str(folder))
        yield folder

"""Laws of the meanings of settings."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import pytest

from mpgrasp.camera.config import CameraConfig
from mpgrasp.camera.noise import DepthNoise
from mpgrasp.controllers.config import ReachConfig
from mpgrasp.controllers.grid_map import GridConfig
from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.detectors.config import NetworkDetectorConfig, OracleConfig
from mpgrasp.episode.config import ClearingConfig, EpisodeConfig
from mpgrasp.files.field_docs import field_docs
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.ik_config import IkConfig
from mpgrasp.motion.reflex import ReflexConfig
from mpgrasp.motion.trajectory import MotionConfig
from mpgrasp.scene.config import SceneConfig


@dataclass
class Base:
    """No field."""

    a: int = 0
    """Of the
    base."""
    b: int = 0
    """Of the base."""
    c: int = 0


@dataclass
class Derived(Base):
    b: int = 1
    """Of the derived one."""
    d: int = 2


def test_a_docstring_stands_on_one_line_and_a_class_goes_before_its_base() -> None:
    assert field_docs(Derived) == {"a": "Of the base.", "b": "Of the derived one."}


@pytest.mark.parametrize(
    "kind",
    [SceneConfig, EpisodeConfig, ClearingConfig, ExecutionConfig, DepthNoise, CameraConfig, MotionConfig,
     IkConfig, ReflexConfig, ReachConfig, GridConfig, NetworkDetectorConfig, HandGeometry,
     OracleConfig],
)  # fmt: skip
def test_every_setting_has_a_meaning(kind: type[Any]) -> None:
    assert [field.name for field in fields(kind) if field.name not in field_docs(kind)] == []

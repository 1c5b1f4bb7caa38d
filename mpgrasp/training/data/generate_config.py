"""Settings of a training set: it is a function of them alone, whatever the number of workers."""

from __future__ import annotations

from dataclasses import dataclass

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.exceptions import ConfigError


@dataclass(frozen=True, kw_only=True)
class GenerateConfig:
    """Settings of a training set."""

    scenes: int
    """Number of scenes."""
    seed: int = 1
    """Seed of the data set; scene k of a seed is the same in every set of one format."""
    views: int = 4
    """Images of each scene."""
    camera: str = "auto"
    """Camera backend."""
    colour: bool = True
    """Store colour beside depth, which takes GL."""

    def __post_init__(self) -> None:
        for name, least in (("scenes", 1), ("views", 1), ("seed", 0)):
            if getattr(self, name) < least:
                raise ConfigError(
                    f"unusable number of {name}", got=getattr(self, name), allowed=f"{least} or more"
                )
        if self.camera not in BACKENDS:
            raise ConfigError("unknown camera backend", got=self.camera, allowed=BACKENDS)
        if self.colour and self.camera == "ray":
            raise ConfigError("rays see no colour", got="camera ray", allowed="gl, or --no-colour")

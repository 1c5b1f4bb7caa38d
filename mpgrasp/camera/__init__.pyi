"""Names of this package and where they live; `lazy_loader` loads each when it is first used."""

from .noise import DepthNoise as DepthNoise
from .wrist_camera import WristCamera as WristCamera

"""Names of this package and where they live; `lazy_loader` loads each when it is first used."""

from .config import SceneConfig as SceneConfig
from .scene import Scene as Scene
from .scene import build_scene as build_scene
from .simulation import Simulation as Simulation

"""Names of this package and where they live; `lazy_loader` loads each when it is first used."""

from .api.evaluation import evaluate as evaluate
from .api.results import Results as Results
from .api.views import EpisodeView as EpisodeView
from .api.views import SceneView as SceneView
from .api.views import episode as episode
from .api.views import scene as scene
from .camera.noise import DepthNoise as DepthNoise
from .camera.wrist_camera import WristCamera as WristCamera
from .controllers import make_controller as make_controller
from .controllers.controller import Command as Command
from .controllers.controller import Controller as Controller
from .controllers.controller import Observation as Observation
from .controllers.grid_map import GridMap as GridMap
from .depth import CameraIntrinsics as CameraIntrinsics
from .depth import DepthFrame as DepthFrame
from .detectors import make_detector as make_detector
from .detectors.detector import GraspDetector as GraspDetector
from .episode.config import EpisodeConfig as EpisodeConfig
from .episode.episode import run_episode as run_episode
from .episode.result import EpisodeResult as EpisodeResult
from .exceptions import MpgraspError as MpgraspError
from .grasp import Grasp as Grasp
from .grasp import GraspMap as GraspMap
from .height_map import HeightMap as HeightMap
from .outcome import Outcome as Outcome
from .scene.config import SceneConfig as SceneConfig
from .scene.scene import build_scene as build_scene
from .scene.simulation import Simulation as Simulation

__version__: str

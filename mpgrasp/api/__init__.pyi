"""Names of this package and where they live; `lazy_loader` loads each when it is first used."""

from .evaluation import evaluate as evaluate
from .results import Results as Results
from .views import EpisodeView as EpisodeView
from .views import SceneView as SceneView
from .views import episode as episode
from .views import scene as scene

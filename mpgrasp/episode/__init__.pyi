"""Names of this package and where they live; `lazy_loader` loads each when it is first used."""

from .clearing import run_clearing as run_clearing
from .config import ClearingConfig as ClearingConfig
from .config import EpisodeConfig as EpisodeConfig
from .episode import Episode as Episode
from .episode import run_episode as run_episode
from .result import ClearingResult as ClearingResult
from .result import EpisodeResult as EpisodeResult

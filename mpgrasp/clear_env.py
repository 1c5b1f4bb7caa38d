"""The clearing task as a gymnasium environment: attempt after attempt, until the table is clear.

Actions and observations are those of `mpgrasp.env`; with MP-PC's own actions an episode ends as in the
benchmark's suite `stacked`. Gymnasium knows it as `mpgrasp/Clear-v0`.
"""

from __future__ import annotations

from typing import Any

from mpgrasp.env import GraspEnv, Info, Seen
from mpgrasp.episode.clearing import Clearing
from mpgrasp.episode.config import ClearingConfig
from mpgrasp.episode.episode import Episode
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import Grasp


class ClearEnv(GraspEnv):
    """A table to be cleared into a basket (the paper's Table VI); one episode is many attempts.

    Each attempt is a reach of `GraspEnv`, with the same actions and observations; `time` begins anew with
    each. The step that comes down to z_min also grasps, carries what is held to the basket and brings the arm
    back to its start, and gives the first view of the next attempt. A protective stop or a reach that takes
    too long ends the attempt, not the episode, as in the benchmark.

    Reward: 1 for each object that comes to lie in the basket. The episode is terminated once nothing is left
    on the table, the suite's `time_limit` is over, or nothing was found several times in a row.

    Info: as `GraspEnv`; after an attempt `pick`, its outcome; after the last step `result` is the
    `ClearingResult`, and `is_success` says whether everything lies in the basket.

    Args:
        suite: name, path or declaration, of trial "clear".
        arguments: as `GraspEnv`.

    Raises:
        ConfigError: a suite of single grasps, or what `GraspEnv` refuses.
    """

    def __init__(self, suite: Any = "stacked", *arguments: Any, **keywords: Any) -> None:
        super().__init__(suite, *arguments, **keywords)
        if self.suite.trial != "clear" or not isinstance(self.config, ClearingConfig):
            raise ConfigError(
                "nothing is cleared there",
                got=f"suite {self.suite.name}, {type(self.config).__name__}",
                allowed='a suite of trial "clear", such as stacked, and ClearingConfig',
            )
        self._clearing_config = self.config

    def _begin(self, episode: Episode) -> None:
        self._clearing = Clearing(episode, self.mppc, self._clearing_config)
        self._clearing.begin()

    def _end(
        self, episode: Episode, grasp: Grasp | None, observed: Seen, info: Info
    ) -> tuple[Seen, float, bool, bool, Info]:
        pick = self._clearing.take(grasp).result
        reward, outcome = float(pick.success), self._clearing.ending()
        told: Info = {"pick": pick.outcome.value, "reflex": str(pick.reflex or "")}
        if outcome is None:
            self._clearing.begin()
            observed, info = self._look(episode)
            self._over = False
            return observed, reward, False, False, info | told
        result = self._clearing.conclude(outcome)
        told |= {"outcome": outcome.value, "is_success": result.success, "result": result}
        return observed, reward, True, False, info | told

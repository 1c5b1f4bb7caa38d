from __future__ import annotations

import math
from dataclasses import replace

from mpgrasp.episode.result import ClearingResult, EpisodeResult, Pick
from mpgrasp.outcome import Outcome

ATTEMPT = EpisodeResult(
    outcome=Outcome.SUCCESS, object="o", sim_time_s=5.0, ticks=50, reflex=None, min_singular_value=0.1,
    near_singularity_s=0.0, path_length_m=0.3, jerk_rms=2.0, spectral_arc_length=-1.4, first_detection_s=1.0,
    blind_drift_m=0.01, grasp=None, timing={}, state_hash="",
)  # fmt: skip


def clearing(*attempts: EpisodeResult) -> ClearingResult:
    return ClearingResult(
        outcome=Outcome.SUCCESS, picks=tuple(Pick(result=a, start_s=0.0, end_s=9.0) for a in attempts),
        in_basket=(), knocked_off=(), left=(), sim_time_s=9.0, time_limit_s=900.0, ticks=50, stops=(),
        min_singular_value=0.1, near_singularity_s=0.0, timing={}, state_hash="",
    )  # fmt: skip


def test_medians_over_attempts_are_of_those_in_which_the_arm_was_measured() -> None:
    # NaN stands wherever sorting would leave it, and each of these has the median -2 without it
    for values in ([math.nan, -1.0, -2.0, -3.0], [-1.0, math.nan, -3.0], [-2.0, math.nan]):
        record = clearing(*(replace(ATTEMPT, spectral_arc_length=v) for v in values)).as_record()
        assert record["spectral_arc_length"] == -2.0
    unseen = clearing(replace(ATTEMPT, first_detection_s=None), replace(ATTEMPT, first_detection_s=3.0))
    assert unseen.as_record()["first_detection_s"] == 3.0


def test_what_no_attempt_has_measured_has_no_median() -> None:
    record = clearing(replace(ATTEMPT, spectral_arc_length=math.nan, first_detection_s=None)).as_record()
    assert record["spectral_arc_length"] is None
    assert record["first_detection_s"] is None
    assert clearing().as_record()["path_length_m"] is None

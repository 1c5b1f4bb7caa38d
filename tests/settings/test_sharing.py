"""Laws of the settings of what plays."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from mpgrasp.controllers.config import MPPC, MVP, PRESETS, ReachConfig
from mpgrasp.detectors.config import NetworkDetectorConfig, OracleConfig
from mpgrasp.exceptions import ConfigError
from mpgrasp.settings.sharing import controller_settings, detector_settings


class Tunable:
    """A plug-in that takes settings."""

    def __init__(self, threshold: float = 0.5, weights: str | None = None, **more: Any) -> None: ...


class Fixed:
    """A plug-in that takes two settings, one of them not by keyword."""

    def __init__(self, first: float = 1.0, /, threshold: float = 0.5) -> None: ...


TUNABLE, FIXED = f"{__name__}:Tunable", f"{__name__}:Fixed"


def test_without_settings_everybody_keeps_the_defaults() -> None:
    assert controller_settings(("mppc", "mvp"), {}) == {"mppc": MPPC, "mvp": MVP}
    found = detector_settings(("dhrnet", "oracle", FIXED), {})
    assert found == {"dhrnet": NetworkDetectorConfig(), "oracle": OracleConfig(), FIXED: {}}


def test_a_setting_goes_to_every_one_that_has_it() -> None:
    found = controller_settings(("mppc", "open_loop", FIXED), {"gamma": 2.0, "min_quality": 0.3})
    assert found["mppc"] == replace(MPPC, gamma=2.0, min_quality=0.3)
    loop = found["open_loop"]
    assert isinstance(loop, ReachConfig)
    assert (loop.min_quality, loop.gamma) == (0.3, controller_settings(("open_loop",), {})["open_loop"].gamma)  # type: ignore[union-attr]
    assert found[FIXED] == {}
    assert detector_settings(("oracle", "dhrnet", FIXED), {"threshold": 1, "play": 0.0}) == {
        "oracle": OracleConfig(play=0.0),
        "dhrnet": NetworkDetectorConfig(),
        FIXED: {"threshold": 1},
    }


def test_a_plug_in_with_any_keyword_takes_all_but_its_weights() -> None:
    assert detector_settings((TUNABLE,), {"anything": [1]}) == {TUNABLE: {"anything": [1]}}
    with pytest.raises(ConfigError, match=r"detector\.weights: no setting of"):
        detector_settings((TUNABLE,), {"weights": "net.pt"})


@pytest.mark.parametrize("key", ["first", "size"])
def test_a_plug_in_that_does_not_take_a_keyword_says_so(key: str) -> None:
    with pytest.raises(ConfigError, match=f"detector.{key}: no setting of {FIXED}; .*keywords that"):
        detector_settings((FIXED,), {key: 1})


def test_a_setting_that_nobody_has_is_refused_with_all_names() -> None:
    with pytest.raises(ConfigError, match=r"controller\.threshold: no setting of mppc, mvp; .*grid, gamma"):
        controller_settings(("mppc", "mvp"), {"threshold": 0.3})


def test_a_setting_without_effect_on_anybody_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"controller\.peak_threshold has no effect: alpha is 1"):
        controller_settings(("mvp",), {"peak_threshold": 0.5})
    assert controller_settings(("mvp", "mppc"), {"peak_threshold": 0.5})["mppc"] == replace(
        MPPC, peak_threshold=0.5
    )


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_the_base_of_the_settings_of_mvp_and_mppc_alone(name: str) -> None:
    found = controller_settings(("mvp", "mppc", "open_loop"), {"gamma": 3.0}, name)
    assert found["mvp"] == replace(PRESETS[name]["mvp"], gamma=3.0)
    assert found["mppc"] == replace(PRESETS[name]["mppc"], gamma=3.0)
    assert found["open_loop"] == controller_settings(("open_loop",), {})["open_loop"]


@pytest.mark.parametrize(
    ("names", "preset", "message"),
    [(("mvp",), "table2", "unknown preset; got 'table2'; allowed: table1, published-grid, robust"),
     (("open_loop",), "table1", "--preset table1 has no effect; got 'open_loop'; allowed: mvp, mppc")],
)  # fmt: skip
def test_a_preset_that_cannot_be_used_is_refused(names: tuple[str, ...], preset: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        controller_settings(names, {}, preset)

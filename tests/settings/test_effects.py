"""Laws of settings that do nothing beside others."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from mpgrasp.camera.noise import DepthNoise, apply
from mpgrasp.controllers.config import MPPC, MVP, ReachConfig
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.motion.ik_config import IkConfig
from mpgrasp.motion.ik_program import ToolTask
from mpgrasp.scene.config import SceneConfig
from mpgrasp.settings import effects
from mpgrasp.settings.effects import leaves, reason_idle

STACK = SceneConfig(objects=("key",), placing="stack", pattern=((0.0, 0.0, 0.0),))


@pytest.mark.parametrize(
    ("group", "key", "config", "because"),
    [
        ("scene", "half_extent", STACK, "placing is stack"),
        ("scene", "jitter", SceneConfig(), "placing is not stack"),
        ("scene", "cloth_wavelength", SceneConfig(cloth_unevenness=0.0), "cloth_unevenness is 0"),
        ("sensor", "correlation_px", DepthNoise(subpixel=0.0), "subpixel is 0"),
        ("controller", "grid.weighted", MPPC, "choice is pool"),
        ("controller", "cost_heights", replace(MVP, gamma=0.0), "gamma is 0"),
        ("controller", "z_max", replace(MVP, gamma=0.0, cost_heights=None), "gamma is 0"),
        ("controller", "yaw_range", replace(MVP, yaw_gain=0.0), "yaw_gain is 0"),
        ("controller", "yaw_gain", replace(MVP, yaw_rate_max=0.0), "yaw_rate_max is 0"),
        ("ik", "posture_rate", IkConfig(posture_cost=0.0), "posture_cost is 0"),
        ("ik", "posture_smoothing", IkConfig(posture_rate=0.0), "posture_rate is 0"),
    ],
)  # fmt: skip
def test_a_setting_is_idle_beside_another_and_has_an_effect_without_it(
    group: str, key: str, config: Any, because: str
) -> None:
    assert reason_idle(group, key, [config]) == because
    plain = {
        "scene": STACK if key == "jitter" else SceneConfig(),
        "controller": replace(MVP, cost_heights=None),
    }
    awake = plain.get(group) or type(config)()
    assert reason_idle(group, key, [awake]) is None
    assert reason_idle(group, key, [config, awake]) is None


def test_all_that_a_setting_goes_to_may_have_reasons_of_their_own() -> None:
    configs = [MVP, replace(MVP, gamma=0.0, cost_heights=None)]
    assert reason_idle("controller", "z_max", configs) == "there are cost_heights and gamma is 0"
    assert reason_idle("controller", "z_max", []) is None


def test_every_rule_is_about_settings_that_there_are() -> None:
    config = EpisodeConfig()
    whole: dict[str, Any] = {"scene": SceneConfig(), "controller": ReachConfig(), "episode": config}
    for group, idles in effects._GROUPS.items():
        known = set(keys(whole.get(group) or getattr(config, group)))
        assert {key for idle in idles for key in idle.keys} <= known, group


def keys(config: Any, before: str = "") -> list[str]:
    found = []
    for field in fields(config):
        value = getattr(config, field.name)
        inner = keys(value, f"{before}{field.name}.") if is_dataclass(value) else []
        found += [f"{before}{field.name}", *inner]
    return found


def test_leaves_of_a_table_have_dots_between_their_keys() -> None:
    table = {"a": 1, "b": {"c": [2], "d": {"e": None}}, "f": {}}
    assert list(leaves(table)) == [("a", 1), ("b.c", [2]), ("b.d.e", None)]


def test_without_subpixel_noise_its_correlation_changes_no_image() -> None:
    depth = np.linspace(0.3, 0.6, 60 * 80, dtype=np.float32).reshape(60, 80)
    intrinsics = CameraIntrinsics(fx=385.0, fy=385.0, cx=39.5, cy=29.5, width=80, height=60)
    one, other = (
        apply(depth, intrinsics, np.random.default_rng(0), DepthNoise(subpixel=0.0, correlation_px=blur))
        for blur in (0.5, 4.0)
    )
    np.testing.assert_array_equal(one, other)


def test_without_a_posture_cost_the_elbow_s_swing_changes_no_step() -> None:
    rng = np.random.default_rng(0)
    J, error = rng.normal(size=(6, 7)), rng.normal(size=6)
    found = [ToolTask(J, error, swing, 0.0).compute_qp_objective(None) for swing in rng.normal(size=(2, 7))]  # type: ignore[arg-type]
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)

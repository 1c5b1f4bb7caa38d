"""Laws of the sensors that training views are seen through."""

from __future__ import annotations

import numpy as np

from mpgrasp.training.data import sensors


def test_no_training_sensor_has_the_errors_that_the_ladder_of_transfer_asks_for() -> None:
    rng = np.random.default_rng(0)
    drawn = [sensors.random_sensor(rng) for _ in range(200)]
    assert all(s.flying == s.multipath == s.dropout == 0 for s in drawn)


def test_sensors_differ_in_everything_that_is_drawn() -> None:
    rng = np.random.default_rng(1)
    drawn = [vars(sensors.random_sensor(rng)) for _ in range(200)]
    varied = {name for name in drawn[0] if len({values[name] for values in drawn}) > 1}
    assert varied == {
        "baseline", "subpixel", "correlation_px", "disparity_step", "shadows", "max_incidence",
        "fixed_pattern", "pattern_px", "multiplicative",
    }  # fmt: skip
    noise = [values["subpixel"] for values in drawn]
    assert min(noise) < 0.03 < 0.08 < 0.4 < max(noise)


def test_waves_have_the_size_that_the_sensor_says() -> None:
    rng = np.random.default_rng(2)
    noise = next(s for s in iter(lambda: sensors.random_sensor(rng), None) if s.fixed_pattern > 0)
    fields = [sensors.waves(noise, (200, 220), 1.0, np.random.default_rng(k)) for k in range(20)]
    drawn = np.array([field for field in fields if field is not None])
    assert len(drawn) == 20
    assert np.isclose(np.std(drawn), noise.fixed_pattern, rtol=0.15)
    without = next(s for s in iter(lambda: sensors.random_sensor(rng), None) if s.fixed_pattern == 0)
    assert sensors.waves(without, (20, 22), 1.0, rng) is None


def test_a_bad_border_changes_what_it_marks_and_nothing_else() -> None:
    rng = np.random.default_rng(4)
    depth = rng.uniform(0.3, 0.5, (90, 110)).astype(np.float32)
    spoilt_views, sides = 0, np.zeros(4, bool)
    for _ in range(200):
        changed, bad = sensors.bad_border(depth, rng)
        assert (changed[~bad] == depth[~bad]).all()
        assert (np.isnan(changed[bad]) | (changed[bad] != depth[bad])).all()
        far = sensors.BORDER_PX[1]
        assert not bad[far:-far, far:-far].any()
        spoilt_views += bool(bad.any())
        sides |= [bad[0, far:-far].any(), bad[-1, far:-far].any(), bad[far:-far, 0].any(),
                  bad[far:-far, -1].any()]  # fmt: skip
    assert sides.all()
    assert abs(spoilt_views / 200 - sensors.BAD_BORDER) < 0.1


def test_the_depth_that_is_given_stays_as_it_was() -> None:
    depth = np.full((60, 60), 0.4, np.float32)
    for seed in range(20):
        sensors.bad_border(depth, np.random.default_rng(seed))
    assert (depth == np.float32(0.4)).all()

"""Numbers that options must not take: no numbers at all, infinite ones, absurd ones; see `bad_commands`."""

from __future__ import annotations

_HUGE = "99999999999999999999"
_COUNT = ("0", "-1", "many", "1.5", _HUGE)
_SEED = ("-1", "x", _HUGE)
_ABOVE_0 = ("0", "nan", "inf", "-1")

BAD_NUMBERS: tuple[tuple[str, str, tuple[str, ...], str], ...] = (
    ("bench thin", "--episodes", (*_COUNT, "1e3", "nan", "inf", "", "1000000000"), "1 to 100000"),
    ("bench thin", "--seed", _SEED, "0 or more"),
    ("bench thin", "--workers", ("-1", "two", "100000"), "0 to 256"),
    ("bench thin", "--record", ("-1", "x", "99999999999999"), "0 to 100000"),
    ("bench thin", "--until-ci", (*_ABOVE_0, "100.5", "wide"), "more than 0 to 100 percentage points"),
    ("bench thin", "--max-episodes", ("0", "-5", "all"), "1 to 100000"),
    ("bench thin", "--hang-after", (*_ABOVE_0, "1e300", "soon"), "more than 0 to 604800 s"),
    ("bench single", "--density", (*_ABOVE_0, "1e300"), "1 to 25000 kg/m^3"),
    ("bench single", "--scale", (*_ABOVE_0, "1e300"), "1e-06 to 1000 m"),
    ("bench export run --out new", "--episodes", _COUNT, "1 to 100000"),
    ("bench replay run", "--episode", ("-1", "x", _HUGE), "0 to 99999"),
    ("scene thin", "--seed", _SEED, "0 or more"),
    ("scene thin", "--episode", ("-1", _HUGE), "0 to 99999"),
    ("detectors show oracle", "--height", ("nan", "99", "-1"), "0.1 to 1 m"),
    ("detectors show oracle", "--seed", ("-1",), "0 or more"),
    ("detectors show oracle", "--episode", ("-1",), "0 to 99999"),
    ("detectors check dhrnet", "--frames", _COUNT, "1 to 100000"),
    ("training generate --out data", "--scenes", _COUNT, "1 to 10000000"),
    ("training generate --out data", "--views", ("0", "1000000000"), "1 to 100"),
    ("training generate --out data", "--workers", ("-1", "100000"), "0 to 256"),
    ("training generate --out data", "--seed", ("-1",), "0 or more"),
    ("training train dhrnet --data folder", "--epochs", (*_ABOVE_0, "1e300"), "more than 0 to 100000"),
    ("training train dhrnet --data folder", "--minutes", _ABOVE_0, "more than 0 to 1e+06"),
    ("training train dhrnet --data folder", "--batch", _COUNT, "1 to 65536"),
    ("training train dhrnet --data folder", "--lr", (*_ABOVE_0, "fast"), "more than 0 to 100"),
    ("training train dhrnet --data folder", "--holdout", ("-1", "2", "nan"), "0 to 1"),
    ("training train dhrnet --data folder", "--threads", ("0", "100000000"), "1 to 256"),
    ("training train dhrnet --data folder", "--scale", ("inf",), "more than 0 to 1e+06"),
    ("evaluate cornell folder", "--folds", ("1", "few"), "2 to 100"),
    ("evaluate cornell folder", "--side", (*_ABOVE_0, "1e300"), "32 to 4096 px"),
    ("evaluate cornell folder", "--epochs", (*_ABOVE_0, "1e300"), "more than 0 to 100000"),
    ("evaluate cornell folder", "--batch", ("0", "1.5"), "1 to 65536"),
    ("ablation architecture", "--epochs", ("0",), "1 to 100000"),
    ("ablation architecture", "--lr", ("nan",), "more than 0 to 100"),
    ("ceiling thin --episodes 0", "--grasps", ("0",), "1 to 100000"),
    ("controller_factors", "--workers", ("-1",), "1 to 256"),
    ("held_out", "--workers", ("0",), "1 to 256"),
    ("run_time", "--rounds", ("0", _HUGE), "1 to 100000"),
    ("same_bits", "--episodes", ("0",), "1 to 100000"),
    ("singular_film", "--episode", ("-1",), "0 to 99999"),
    ("bench profile thin", "--episodes", ("0", "few"), "1 to 1000"),
    ("ladder_coverage", "--methods", ("0", "few"), "1 to 100000"),
    ("scaling", "--rounds", ("0", "few"), "1 to 100000"),
    ("thickness", "--scenes", _COUNT, "1 to 100000"),
    ("thickness", "--seed", ("-1",), "0 or more"),
)
"""Command, option, values that it does not take, and those that it does."""

"""Declarations of suites that must be refused: no TOML, unknown keys, values of no use, names of no object.

Each is a suite of one line or two with one thing wrong. They are played by `bad_commands`.
"""

from __future__ import annotations


def _suite(body: str) -> str:
    return f"title = 'x'\n{body}\n"


def _box(box: str = "0.03, 0.03, 0.03", name: str = "'b'", more: str = "") -> str:
    return _suite(f"[scene]\nobjects = [{{name = {name}, box = [{box}]{more}}}]")


_NAME = "unusable name of an object; got '{}'; allowed: 1 to 64 visible characters"
_RESERVED = "reserved name of an object; got '{}'"
_MASS = "unusable mass of object b [kg]; got {}"
_DENSITY = "density out of range [kg/m^3]; got {}"

BAD_SUITES: dict[str, tuple[str, str]] = {
    "no-toml": ("title = ", "suite is not valid TOML"),
    "empty": ("", "title is missing"),
    "no-title": ("trials = 3", "title is missing"),
    "title-number": ("title = 3", "title is unusable; got 3"),
    "unknown-key": (_suite("tirals = 3"), "unknown key; got 'tirals'; allowed: title, trial, trials"),
    "unknown-table": (_suite("[robot]\nname = 'panda'"), "unknown key; got 'robot'"),
    "trials-0": (_suite("trials = 0"), "trials out of range; got 0; allowed: 1 to 100000"),
    "trials-text": (_suite("trials = 'many'"), "trials is unusable; got 'many'"),
    "trials-half": (_suite("trials = 1.5"), "trials is unusable; got 1.5"),
    "trials-endless": (_suite("trials = 9999999999999"), "trials out of range; got 9999999999999"),
    "trial": (_suite("trial = 'dance'"), "trial is unusable; got 'dance'; allowed: grasp, clear"),
    "clear-without-basket": (_suite("trial = 'clear'"), "clearing needs a basket"),
    "scene-unknown": (_suite("[scene]\nobjectz = ['usb_stick']"), "[scene]: unknown key; got 'objectz'"),
    "no-objects": (_suite("[scene]\nobjects = []"), "a scene without objects; got 'objects = []'"),
    "objects-text": (_suite("[scene]\nobjects = 'usb_stick'"), "objects is unusable; got 'usb_stick'"),
    "object-unknown": (_suite("[scene]\nobjects = ['unicorn']"), "unknown object; got 'unicorn'"),
    "object-number": (_suite("[scene]\nobjects = [3]"), "objects is unusable; got [3]"),
    "ten-thousand": (
        _suite("[scene]\nobjects = [" + 10_000 * "'usb_stick', " + "]"),
        "too many objects; got 10000; allowed: up to 40",
    ),
    "named-world": (_box(name="'world'"), _RESERVED.format("world")),
    "named-basket": (_box(name="'basket'"), _RESERVED.format("basket")),
    "named-slash": (_box(name="'a/b'"), _NAME.format("a/b")),
    "named-nothing": (_box(name="''"), _NAME.format("")),
    "named-escape": (_box(name='"\\u001b[31mred"'), _NAME.format("\\\\x1b[31mred")),
    "named-two-lines": (_box(name='"a\\nb"'), _NAME.format("a\\\\nb")),
    "named-long": (_box(name=f"'{300 * 'x'}'"), "unusable name of an object; got 'xxxxx"),
    "box-no-edges": (_suite("[scene]\nobjects = [{name = 'b'}]"), "box is missing; allowed: a list of 3"),
    "box-two-edges": (_box("0.03, 0.03"), "box is unusable; got [0.03, 0.03]; allowed: a list of 3"),
    "box-text": (_box("'wide', 0.03, 0.03"), "box is unusable; got ['wide', 0.03, 0.03]"),
    "box-nan": (_box("nan, 0.03, 0.03"), "box is not finite; got [nan, 0.03, 0.03]"),
    "box-infinite": (_box("inf, 0.03, 0.03"), "box is not finite; got [inf, 0.03, 0.03]"),
    "box-negative": (_box("-0.03, 0.03, 0.03"), "unusable size of a box; got (-0.015, 0.015, 0.015)"),
    "box-zero": (_box("0, 0.03, 0.03"), "unusable size of a box; got (0.0, 0.015, 0.015)"),
    "box-atomic": (_box("1e-9, 1e-9, 1e-9"), _MASS.format("1e-24")),
    "box-house": (_box("5, 5, 5"), _MASS.format("125000.0")),
    "box-density-air": (_box(more=", density = 1e-6"), _DENSITY.format("1e-06")),
    "box-density-star": (_box(more=", density = 1e17"), _DENSITY.format("1e+17")),
    "box-density-nan": (_box(more=", density = nan"), "density is not finite; got nan"),
    "box-colour": (_box(more=", colour = 'red'"), "unknown key; got 'colour'; allowed: box, name, density"),
    "count-0": (_suite("[scene]\ncount = 0"), "unusable count of objects; got 0"),
    "count-99": (_suite("[scene]\ncount = 99"), "too many objects; got 99"),
    "placing": (_suite("[scene]\nplacing = 'thrown'"), "placing is unusable; got 'thrown'"),
    "centre-nan": (_suite("[scene]\ncentre = [nan, 0]"), "centre is not finite; got [nan, 0]"),
    "half-extent": (
        _suite("[scene]\nhalf_extent = 5.0"),
        "half extent of the placing region [m]",
    ),
    "jitter-nan": (_suite("[episode]\nstart_jitter = nan"), "start_jitter is not finite; got nan"),
    "jitter-infinite": (_suite("[episode]\nstart_jitter = inf"), "start_jitter is not finite; got inf"),
    "control-dt": (_suite("[episode]\ncontrol_dt = 1e-9"), "control_dt out of range; got 1e-09"),
    "reach-time": (_suite("[episode]\nmax_reach_time = inf"), "max_reach_time is not finite; got inf"),
    "crop-0": (_suite("[camera]\ncrop = 0"), "unusable crop of the camera; got 0; allowed: 1 to 480"),
    "crop-huge": (_suite("[camera]\ncrop = 1000000"), "unusable crop of the camera; got 1000000"),
    "motion-dt": (_suite("[motion]\ndt = 1e-9"), "dt out of range; got 1e-09; allowed: 0.002 to 0.05"),
    "sensor-text": (_suite("[sensor]\nsubpixel = 'little'"), "subpixel is unusable; got 'little'"),
    "ik-unknown": (_suite("[ik]\nmagic = true"), "[ik]: unknown key; got 'magic'; allowed: damping"),
    "reflex-shape": (_suite("[reflex]\ndq_max = [1, 2, 3]"), "dq_max has the wrong shape; got (3,)"),
    "controller-unknown": (_suite("[controller]\ngama = 1.0"), "no setting of mppc; got 1.0"),
    "controller-nan": (_suite("[controller]\ngamma = nan"), "gamma is not finite; got nan"),
    "turns-empty": (_suite("turns = []"), "has no scene; allowed: one scene or more"),
    "turns-text": (_suite("turns = 'all'"), "turns is unusable; got 'all'; allowed: a list of tables"),
    "turn-unknown": (_suite("[[turns]]\nobjectz = []"), "[scene]: unknown key; got 'objectz'"),
    "turns-many": (_suite(20_000 * "[[turns]]\n"), "has too many turns; got 20000; allowed: up to 500"),
}
"""Content, and words of the one line that refuses it, by name."""

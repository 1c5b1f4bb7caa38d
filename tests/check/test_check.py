"""The conformance kit finds out what is wrong, and lets pass what is right."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from bad_plug_ins import BAD_PLUG_INS, GUARDED, KIT, LOADED, SOUND_CONTROLLER, SOUND_DETECTOR

import mpgrasp
from mpgrasp.check.__main__ import main
from mpgrasp.check.controller_subject import ControllerSubject
from mpgrasp.check.detector_subject import DetectorSubject
from mpgrasp.check.laws import Broken, Finding, Law, Skipped, State, try_laws
from mpgrasp.check.trial import CONTROLLER_LAWS, DETECTOR_LAWS, try_controller, try_detector
from mpgrasp.check.verdict import Verdict
from mpgrasp.controllers import CONTROLLERS
from mpgrasp.detectors.networks.registry import OPENING_FULLY
from mpgrasp.exceptions import ConfigError
from mpgrasp.foreign_code import LIMIT_VARIABLE
from mpgrasp.paths import WEIGHTS
from mpgrasp.plugins import load_controller, load_detector

SHIPPED = ("oracle", *sorted(path.stem for path in WEIGHTS.glob("*.safetensors")))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a user's modules."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def verdict_on(kind: str, name: str) -> Verdict:
    return try_detector(name) if kind == "detector" else try_controller(name)


@pytest.mark.parametrize("name", KIT)
def test_a_bad_plug_in_is_found_out_with_a_reason(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name == "hangs-later":
        monkeypatch.setenv(LIMIT_VARIABLE, "0.2")
    bad = KIT[name]
    path = bad.write(folder, f"kit_{name.replace('-', '_')}")
    findings = tried(bad.kind, path, bad.said.partition(":")[0])
    broken = [f"{finding.name}: {finding.reason}" for finding in findings if finding.broken]
    assert any(re.search(bad.said, text) for text in broken), broken
    verdict = Verdict(kind=bad.kind, name=path, findings=findings)
    assert not verdict.fit
    assert verdict.words().startswith(f"NOT FIT: {path} breaks 1 of 1 laws")


def tried(kind: str, path: str, name: str) -> list[Finding]:
    """The finding of the law of that name; of the second where there is none."""
    if kind == "detector":
        detector_laws = [law for law in DETECTOR_LAWS if law.name == name] or [DETECTOR_LAWS[1]]
        return try_laws(detector_laws, DetectorSubject.of(lambda: load_detector(path)), path)
    controller_laws = [law for law in CONTROLLER_LAWS if law.name == name] or [CONTROLLER_LAWS[1]]
    return try_laws(controller_laws, ControllerSubject.of(lambda: load_controller(path)), path)


@pytest.mark.parametrize("name", ["quality-logits", "width-nan", "twist-nan", "grasp-degrees"])
def test_the_kit_finds_out_what_the_guards_refuse(name: str, folder: Path) -> None:
    bad = GUARDED[name]
    verdict = verdict_on(bad.kind, bad.write(folder, f"guarded_{name.replace('-', '_')}"))
    assert any(re.search(bad.said, finding.reason) for finding in verdict.findings if finding.broken)


@pytest.mark.parametrize("kind", ["detector", "controller"])
def test_sound_plug_ins_follow_every_law_and_every_advice(kind: str, folder: Path) -> None:
    source = {"detector": SOUND_DETECTOR, "controller": SOUND_CONTROLLER}[kind]
    (folder / f"sound_{kind}.py").write_text(source)
    verdict = verdict_on(kind, f"sound_{kind}:Sound")
    assert [f"{f.name}: {f.reason}" for f in verdict.findings if f.state is not State.PASSED] == []
    assert verdict.fit


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Torch on one thread, as in every command of mpgrasp; several wait for each other on a busy machine."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.usefixtures("one_thread")
def test_the_detectors_with_weights_that_ship_keep_every_law(name: str) -> None:
    verdict = try_detector(name, runtime="torch")
    ample = "opening no wider than needed"
    laws = [f for f in verdict.findings if f.must or f.name == ample]
    broken = [f.name for f in laws if f.state is not State.PASSED]
    assert broken == ([ample] if name in OPENING_FULLY else [])


@pytest.mark.parametrize("name", CONTROLLERS)
def test_the_projects_controllers_keep_every_law(name: str) -> None:
    verdict = try_controller(name)
    assert [f"{f.name}: {f.reason}" for f in verdict.findings if f.must and f.state is not State.PASSED] == []
    not_followed = {f.name for f in verdict.findings if f.state is State.FAILED}
    assert not_followed == ({"leaves an empty table"} if name in ("mvp", "mppc") else set())


def test_there_are_bad_plug_ins_enough() -> None:
    assert len(BAD_PLUG_INS) >= 35
    for by, part in {"guard": GUARDED, "loader": LOADED, "kit": KIT}.items():
        assert [name for name, bad in BAD_PLUG_INS.items() if bad.by == by] == list(part)


ADVICE: dict[str, tuple[str, str, str]] = {
    "prints nothing": (
        "detector", "def predict(self, frame): print('hi'); return super().predict(frame)", "'hi'"
    ),
    "fast enough": (
        "detector", "def predict(self, frame): import time; time.sleep(0.12); return "
        "super().predict(frame)", "ms"
    ),
    "empty table": (
        "detector",
        "def predict(self, frame):\n        m = super().predict(frame); lost = np.isnan(frame.depth).all()\n"
        "        return m if lost else replace(m, quality=np.maximum(m.quality, 0.8))",
        "quality 0.80",
    ),
    "opening no wider than needed": (
        "detector",
        "def predict(self, frame):\n        m = super().predict(frame)\n"
        "        return replace(m, width=2 * m.width)",
        "opening of 78 mm",
    ),
    "remembers failures": (
        "controller", "def remember_failure(self, position): pass", "does not take the other"
    ),
}  # fmt: skip


@pytest.mark.parametrize("check", ADVICE)
def test_advice_is_given_and_makes_nobody_unfit(check: str, folder: Path) -> None:
    kind, body, said = ADVICE[check]
    module = f"advised_{check.replace(' ', '_')}"
    source = SOUND_DETECTOR if kind == "detector" else SOUND_CONTROLLER
    (folder / f"{module}.py").write_text(f"{source}\n\nclass Advised(Sound):\n    {body}\n")
    (finding,) = tried(kind, f"{module}:Advised", check)
    verdict = Verdict(kind=kind, name=f"{module}:Advised", findings=[finding])
    assert (finding.state, finding.must) == (State.FAILED, False)
    assert said in finding.reason
    assert verdict.fit
    assert f"Worth a look: {check}" in verdict.words()


def test_a_detector_that_claims_nothing_is_not_tried_on_units(folder: Path) -> None:
    blind = "class Blind(Sound):\n    def predict(self, frame):\n        m = super().predict(frame)\n"
    (folder / "blind.py").write_text(
        f"{SOUND_DETECTOR}\n\n{blind}        return replace(m, quality=0 * m.quality)\n"
    )
    verdict = try_detector("blind:Blind")
    skipped = [f.name for f in verdict.findings if f.state is State.SKIPPED]
    assert skipped == [
        "place of the grasp",
        "unit of the width",
        "direction of the angle",
        "opening no wider than needed",
        "mirror symmetry",
    ]
    assert not verdict.fit
    assert "3 could not be tried" in verdict.words()


def test_a_controller_without_a_memory_of_failures_is_said_to_have_none(folder: Path) -> None:
    source = SOUND_CONTROLLER.replace("remember_failure", "recall")
    (folder / "forgetful.py").write_text(source)
    (finding,) = tried("controller", "forgetful:Sound", "remembers failures")
    assert finding.state is State.SKIPPED
    assert "remember_failure(position)" in finding.reason


def test_after_a_check_that_hangs_the_others_are_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "0.1")
    tried: list[str] = []

    def hangs(subject: int) -> str:
        tried.append("slow")
        time.sleep(30)
        return ""

    laws = [
        Law(name="slow", must=False, check=hangs),  # an advice: that it hangs is more than slow
        Law(name="other", check=lambda subject: tried.append("other") or ""),  # type: ignore[func-returns-value]
    ]
    findings = try_laws(laws, 0, "my:Net")
    assert tried == ["slow"]
    assert [finding.state for finding in findings] == [State.FAILED, State.SKIPPED]
    assert findings[0].broken
    assert findings[1].reason == 'not tried after the check "slow" took too long'


def test_a_law_that_raises_is_broken_and_one_that_skips_is_not() -> None:
    def raises(error: Exception) -> Any:
        def check(subject: int) -> str:
            raise error

        return check

    laws = [
        Law(name="a", check=lambda subject: f"{subject}"),
        Law(name="b", check=raises(Broken("for\na reason"))),
        Law(name="c", check=raises(Skipped("nothing there"))),
        Law(name="d", check=raises(KeyError("x")), must=False),
        Law(name="e", check=raises(ConfigError("wrong", got=1))),
    ]
    found = [(f.state.value, f.reason, f.broken) for f in try_laws(laws, 7, "m:C")]
    assert found == [
        ("passed", "7", False),
        ("failed", "for a reason", True),
        ("skipped", "nothing there", False),
        ("failed", "it raises KeyError: 'x'", False),
        ("failed", "wrong; got 1", True),
    ]


def test_every_check_has_a_name_of_its_own_and_laws_come_in_both_kinds() -> None:
    for laws in (DETECTOR_LAWS, CONTROLLER_LAWS):
        names = [law.name for law in laws]
        assert len(set(names)) == len(names)
        assert {law.must for law in laws} == {True, False}


def test_the_command_prints_a_verdict_and_its_exit_code_says_it_too(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["controller", "open_loop"]) == 0
    printed = capsys.readouterr().out
    assert "FIT: open_loop keeps 10 of 10 laws." in printed
    assert "takes a lone peak" in printed
    source = "from mpgrasp.controllers.open_loop import OpenLoop\n\n\nclass Idle(OpenLoop):\n"
    (folder / "idle.py").write_text(f"{source}    def final_grasp(self): return None\n")
    assert main(["controller", "idle:Idle", "--json"]) == 1
    read = json.loads(capsys.readouterr().out)
    assert (read["kind"], read["name"], read["fit"]) == ("controller", "idle:Idle", False)
    rows = {row["check"]: row for row in read["findings"]}
    assert [name for name, row in rows.items() if row["state"] == "failed" and row["must"]] == [
        "takes a lone peak"
    ]
    assert rows["remembers failures"]["must"] is False


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "required: detector|controller"),
        (["detector", "resnet"], "unknown detector; got 'resnet'"),
        (["controller", "./my.py:C"], "no such file of a controller plug-in"),
        (["detector", "no_such_module:C"], "cannot be imported"),
        (["detector", "oracle", "--set", "controller.gamma=1"], "--set of another group"),
        (["detector", "oracle", "--set", "detector.crop=1"], "no setting of oracle"),
        (["detector", "dhrnet", "--weights", "absent.pt"], "no such weights file"),
    ],
)
def test_unusable_input_is_one_line_and_exit_code_2(
    words: list[str], said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    printed = capsys.readouterr()
    assert said in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""


def test_settings_reach_a_plug_in(folder: Path) -> None:
    tuned = "class Tuned(Sound):\n    def __init__(self, name='plain'):\n        self.name = name\n"
    (folder / "tuned.py").write_text(f"{SOUND_DETECTOR}\n\n{tuned}")
    (finding, *_) = try_detector("tuned:Tuned", {"name": "fancy"}).findings
    assert finding == Finding(name="name", must=True, state=State.PASSED, reason="fancy")


def test_the_document_shows_what_the_kit_prints(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (Path(mpgrasp.__file__).parents[1] / "docs" / "extending.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```\n(unit of the width.*?)```", text, re.DOTALL)
    clockwise = KIT["angle-clockwise"].source.replace("class Bad", "class MyDetector")
    (folder / "my_net.py").write_text(clockwise)
    assert main(["detector", "my_net:MyDetector"]) == 1
    printed = words(capsys.readouterr().out)
    rows = re.split(r"\n(?! )", block.strip())
    assert len(rows) == 4
    for row in rows:
        assert words(row) in printed


def words(text: str) -> str:
    """A table's words without its lines."""
    return " ".join(re.sub(r"[│|┃]", " ", text).split())

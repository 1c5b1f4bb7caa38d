"""Laws of settings: declared, set on the command line, printed, recorded, compared."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_runs import records_without_timing, thin_command

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.commands.settings import sections
from mpgrasp.bench.playing.player import Player
from mpgrasp.bench.results.reader import read_run
from mpgrasp.bench.results.run_card import Configuration

THIN = ["thin", "--detector", "oracle", "--controller", "mppc"]
FAKE = "fakes:FakeDetector"


def configuration(out: Path) -> Configuration:
    return read_run(out).configuration


BAD = [
    ("gamma=1", "unusable --set; got 'gamma=1'; allowed: --set GROUP.KEY=VALUE"),
    ("controller.gamma", "unusable --set; got 'controller.gamma'"),
    ("controller.gamma=", "--set controller.gamma is unusable; got ''"),
    ("controller.gamma=4/0", "--set controller.gamma is unusable; got '4/0'"),
    ("controller.gamma=exp(1)", "--set controller.gamma is unusable; got 'exp(1)'"),
    ("lighting.power=1", "--set lighting.power: unknown group of settings; got 'lighting'; allowed: scene, "),
    ("controler.gamma=1", "unknown group of settings; got 'controler'"),
    ("controller.gama=1", "controller.gama: no setting of mppc; got 1; allowed: grid, gamma"),
    ("controller.gamma=nan", "controller of mppc, gamma is not finite; got nan"),
    ("controller.gamma=-1", "controller of mppc: unusable gamma; got -1.0; allowed: >= 0"),
    ("controller.gamma=high", "controller of mppc, gamma is unusable; got 'high'"),
    ("controller.gamma=true", "controller of mppc, gamma is unusable; got True"),
    ("controller.gamma=5cm", "--set controller.gamma is unusable; got '5cm'"),
    ("controller.choice=best", "choice is unusable; got 'best'; allowed: grid, pool"),
    ("controller.grid.size=1", "controller of mppc, grid: unknown key; got 'size'; allowed: cell, extent"),
    ("controller.grid.extent=none", "grid, extent is unusable"),
    ("controller.grid=0.34", "grid is not a table; got 0.34"),
    ("controller.cost_heights=[0.4]", "cost_heights is unusable; got [0.4]"),
    ("controller.z_max=0.6", "controller.z_max has no effect: there are cost_heights"),
    ("controller.z_min=0.7", "unusable heights"),
    ("detector.threshold=0.3", "detector.threshold: no setting of oracle; got 0.3; allowed: pad_width"),
    ("detector.max_opening=0", "detector of oracle: contact width outside of the opening"),
    ("scene.pattern=[[0, 0, 0]]", "--set scene: a pattern needs placing; got 'scatter'; allowed: stack"),
    ("scene.jitter=[0, 0]", "--set scene.jitter has no effect: placing is not stack"),
    ("scene.cloth=1", "--set scene: unknown key; got 'cloth'"),
    ("scene.cloth_unevenness=0.6", "--set scene: unevenness of the cloth [m] out of range; got 0.6"),
    ("scene.count=1.5", "--set scene, count is unusable; got 1.5"),
    ("sensor.subpixels=1", "--set sensor: unknown key; got 'subpixels'; allowed: baseline"),
    ("sensor.subpixel=-0.1", "--set sensor: subpixel of the depth sensor; got -0.1"),
    ("sensor.subpixel=inf", "--set sensor, subpixel is not finite; got inf"),
    ("sensor.shadows=1", "--set sensor, shadows is unusable; got 1"),
    ("camera.crop=481", "--set camera: unusable crop of the camera; got 481; allowed: 1 to 480 [px]"),
    ("camera.crop=350.0", "--set camera, crop is unusable; got 350.0"),
    ("camera.intrinsics.fx=0", "--set camera, intrinsics: unusable camera intrinsics"),
    ("camera.backend=ray", "--set camera: unknown key; got 'backend'; allowed: crop, intrinsics"),
    ("execution.lift=-1", "--set execution: lift must be finite and not negative; got -1.0"),
    ("execution.lift=high", "--set execution, lift is unusable; got 'high'"),
    ("motion.dt=0", "--set motion: dt must be positive; got 0.0"),
    ("motion.smoothing=2.5", "--set motion, smoothing is unusable; got 2.5"),
    ("ik.velocity_fraction=2", "--set ik: velocity_fraction is a share; got 2.0"),
    ("reflex.q_min=[0, 0]", "--set reflex: q_min has the wrong shape; got (2,)"),
    ("reflex.q_min=[0, 0, 0, 0, 0, 0, nan]", "--set reflex, q_min is not finite"),
    ("reflex.dq_max=fast", "--set reflex, dq_max is unusable; got 'fast'"),
    ("episode.noise=false", "--set episode: no suite decides noise; got False; allowed: the option"),
    ("episode.time_limit=100", "--set episode: unknown key; got 'time_limit'"),
    ("episode.control_dt=-0.1", "--set episode: control_dt out of range"),
    ("episode.control_dt=1e-9", "--set episode: control_dt out of range"),
    ("motion.dt=1e-9", "dt out of range"),
    ("episode.ik.dampings=1", "--set ik: unknown key; got 'dampings'"),
    ("episode.execution=5", "--set episode, execution is not a table; got 5"),
    ("controller.gamma=4/3m", "--set controller.gamma is unusable; got '4/3m'"),
    ("controller.gamma=0,4/3", "controller of mppc, gamma is unusable; got [0, 1.3333333333333333]"),
    ("controller.grid.weighted=true", "controller.grid.weighted has no effect: choice is pool"),
    ("controller.grid.cell.x=1", "grid, cell is unusable; got {'x': 1}"),
    ("scene.cloth_wavelength.x=1", "--set scene, cloth_wavelength is unusable"),
    ("sensor=1", "unusable --set; got 'sensor=1'"),
]  # fmt: skip


def refused(capsys: pytest.CaptureFixture[str], words: list[str], message: str) -> None:
    assert main(words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("mpgrasp: error: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err


@pytest.mark.parametrize(("text", "message"), BAD, ids=[text for text, _ in BAD])
def test_a_bad_setting_is_one_line_that_names_the_place_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    refused(capsys, [*THIN, "--out", str(tmp_path / "out"), "--set", text], message)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--no-noise", "--set", "sensor.subpixel=0.1"], "sensor.subpixel has no effect; got '--no-noise'"),
        (["--controller", "mvp", "--set", "controller.peak_threshold=0.5"], "has no effect: alpha is 1"),
        (["--set", "controller.descent=coupled", "--set", "controller.v_z=0.1"], "descent is coupled"),
        (["--set", "ik.collisions=false", "--set", "ik.collision_rate=1"], "no effect: collisions is false"),
        (["--set", "execution.shake_time=0", "--set", "execution.shake_frequency=2"], "shake_time is 0"),
        (["--set", "sensor.subpixel=0", "--set", "sensor.correlation_px=1"], "no effect: subpixel is 0"),
        (["--set", "ik.posture_cost=0", "--set", "ik.posture_rate=1"], "no effect: posture_cost is 0"),
        (["--set", "controller.gamma=0", "--set", "controller.cost_heights=[0.1, 0.2]"], "gamma is 0"),
        (["--set", "controller.grid.cell=0.01", "--set", "controller.grid=1"], "keys within grid are set"),
        (["--set", "controller.grid=1", "--set", "controller.grid.cell=0.01"], "grid has a value already"),
        (["--no-noise", "--set", "episode.sensor.subpixel=0.1"], "subpixel has no effect; got '--no-noise'"),
        (["--preset", "table3"], "--preset: unknown preset; got 'table3'"),
        (["--preset", "robust", "--controller", "open_loop"], "robust has no effect; got 'open_loop'"),
        (["--detector", FAKE, "--set", "detector.threshold=1"], f"detector.threshold: no setting of {FAKE}"),
    ],
)  # fmt: skip
def test_settings_that_do_nothing_together_are_refused_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    refused(capsys, [*THIN, "--out", str(tmp_path / "out"), *words], message)


def test_a_table_of_a_suite_that_cannot_be_used_names_itself(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    for table, message in (
        ("[sensor]\nsubpixel = -1", "suite 'mine', [sensor]: subpixel of the depth sensor"),
        ("[lighting]\npower = 1", "suite 'mine': unknown key; got 'lighting'"),
        ("[motion]\nspeed = 1", "suite 'mine', [motion]: unknown key; got 'speed'"),
        ("[controller]\ngama = 1", "controller.gama: no setting of mppc"),
    ):
        file.write_text(f'title = "T"\n[scene]\nobjects = ["key"]\n{table}\n')
        refused(capsys, ["settings", str(file)], message)


SET = ["controller.gamma=4/3", "controller.grid.extent=0.34", "sensor.subpixel=0.12", "camera.crop=300",
       "execution.lift=0.12", "motion.max_speed=0.2", "ik.damping=1e-6", "reflex.contact_force=80",
       "reflex.dq_max=[2, 2, 2, 2, 2.6, 2.6, 2.6]", "detector.play=0.002", "scene.half_extent=0.1",
       "episode.start_jitter=0"]  # fmt: skip
TABLES = """
[controller]
gamma = 1.3333333333333333
grid = { extent = 0.34 }
[sensor]
subpixel = 0.12
[camera]
crop = 300
[execution]
lift = 0.12
[motion]
max_speed = 0.2
[ik]
damping = 1e-6
[reflex]
contact_force = 80
dq_max = [2, 2, 2, 2, 2.6, 2.6, 2.6]
[detector]
play = 0.002
"""


def test_set_is_the_same_as_the_table_in_a_suite(fake_world: object, tmp_path: Path) -> None:
    head = 'title = "T"\n[scene]\nobjects = ["usb_stick"]\n{}[episode]\n{}'
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    (tmp_path / "a" / "mine.toml").write_text(head.format("", ""))
    (tmp_path / "b" / "mine.toml").write_text(
        head.format("half_extent = 0.1\n", "start_jitter = 0.0\n") + TABLES
    )
    words = [*THIN[1:], "--quiet", "--workers", "0", "--episodes", "1"]
    setting = [word for text in SET for word in ("--set", text)]
    assert main([str(tmp_path / "a" / "mine.toml"), *words, *setting, "--out", str(tmp_path / "x")]) == 0
    assert main([str(tmp_path / "b" / "mine.toml"), *words, "--out", str(tmp_path / "y")]) == 0
    one, other = configuration(tmp_path / "x"), configuration(tmp_path / "y")
    assert one == other
    assert one.settings["controller"]["mppc"]["gamma"] == 1.33333333
    assert one.settings["sensor"]["subpixel"] == 0.12


def test_what_is_set_reaches_what_plays(fake_world: object, tmp_path: Path) -> None:
    made: dict[str, Any] = {}

    def play(scene: Any, seed: int, **parts: Any) -> fakes.FakeResult:
        made.update(parts, scene=scene)
        return fakes.FakeResult(seed, scene)

    from mpgrasp.bench.commands.run import parse
    from mpgrasp.bench.playing.planning import make_plan

    words = [*THIN, "--preset", "published-grid", *(word for text in SET for word in ("--set", text))]
    plan, _ = make_plan(parse(words))
    Player(plan, play).play(next(plan.tasks()))
    assert made["controller"].config.gamma == 4 / 3
    assert made["controller"].config.grid.extent == 0.34
    assert made["controller"].config.descent == "coupled"
    assert made["detector"].config.play == 0.002
    assert made["config"].sensor.subpixel == 0.12
    assert made["config"].camera.crop == 300
    assert made["config"].execution.lift == 0.12
    assert made["config"].motion.max_speed == 0.2
    assert made["config"].ik.damping == 1e-6
    assert made["config"].reflex.contact_force == 80.0
    assert made["config"].start_jitter == 0.0
    assert made["scene"].half_extent == 0.1


@pytest.mark.parametrize("suite", ["thin", "stacked", "unseen"])
def test_every_printed_setting_stands_in_run_json_with_its_value(
    fake_world: pytest.MonkeyPatch, tmp_path: Path, suite: str
) -> None:
    fake_world.setattr("mpgrasp.episode.clearing.run_clearing", fakes.run_episode)
    from mpgrasp.bench.commands.run import parse
    from mpgrasp.bench.playing.description import configuration as describe
    from mpgrasp.bench.playing.planning import make_plan
    from mpgrasp.files.json_values import json_value

    words = [suite, "--detector", "oracle", "--controller", "mppc,open_loop", "--set", "controller.gamma=2"]
    plan, _ = make_plan(parse(words))
    written = describe(plan, Player(plan, fakes.run_episode)).settings
    shown = 0
    for heading, rows in sections(plan, plan.suites[0]):
        name = heading.partition(" of ")[2]
        for row in rows:
            group, *keys = row.path.split(".")
            place = written[group]
            if group == "scene" and isinstance(place, list):
                place = place[int(name.partition("turn ")[2] or 0)]
            for key in (*([name] if group in ("controller", "detector") else []), *keys):
                place = place[key]
            assert place == json_value(row.value), row.path
            shown += 1
    assert shown > 100


def test_the_tree_is_printed_with_values_and_meanings_in_one_column(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = [
        "settings",
        "thin",
        "--detector",
        "oracle",
        "--set",
        "sensor.subpixel=0.12",
        "--preset",
        "robust",
    ]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "[sensor]" in lines
    assert any(line.startswith("  sensor.subpixel=0.12 ") and "[px]" in line for line in lines)
    assert any(line.startswith("  controller.gamma=8.0 ") for line in lines)
    assert any(line.startswith("  camera.intrinsics.fx=385.0 ") for line in lines)
    marks = {
        line.index("#")
        for line in lines
        if "#" in line and not line.strip().startswith(("reflex.", "scene."))
    }
    assert len(marks) == 1
    assert main(["settings", "thin", "--no-noise"]) == 0
    assert "sensor." not in capsys.readouterr().out


def test_what_is_printed_can_be_set(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["settings", "thin", "--detector", "dhrnet", "--controller", "mppc_robust"]
    assert main(words) == 0
    printed = capsys.readouterr().out
    rows = [line.split(" # ")[0].strip() for line in printed.splitlines() if line.startswith("  ")]
    # these have no effect beside the others
    idle = (
        "scene.jitter", "scene.pattern", "scene.cloth_wrinkle_", "scene.no_return_size", "sensor.pattern_",
    )  # fmt: skip
    setting = [word for row in rows if not row.startswith(idle) for word in ("--set", row)]
    assert main([*words, *setting]) == 0
    assert capsys.readouterr().out == printed


def test_a_plug_in_gets_its_settings_by_keyword(fake_world: object, tmp_path: Path) -> None:
    words = ["thin", "--detector", "fakes:TunableDetector", "--controller", "fakes:FakeController", "--quiet"]
    words += ["--workers", "0", "--episodes", "1", "--out", str(tmp_path), "--set", "detector.threshold=1/4"]
    assert main(words) == 0
    assert configuration(tmp_path).settings["detector"] == {"fakes:TunableDetector": {"threshold": 0.25}}


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("sensor.subpixel=0.2", "settings.sensor.subpixel: 0.1 there, 0.2 here"),
        ("scene.half_extent=0.1", "settings.scene.half_extent: 0.15 there, 0.1 here"),
        ("execution.lift=0.1", "settings.execution.lift: 0.15 there, 0.1 here"),
    ],
)
def test_another_setting_is_refused_by_its_path_when_a_run_is_resumed(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: str, named: str
) -> None:
    out = tmp_path / "run"
    assert main(thin_command(out, "--set", "sensor.subpixel=0.1", episodes=1)) == 0
    before = records_without_timing(out)
    capsys.readouterr()
    assert main(["--resume", str(out), "--set", change]) == 2
    assert f"cannot resume with another configuration ({named})" in capsys.readouterr().err
    assert main(["--resume", str(out)]) == 0
    assert records_without_timing(out) == before


def test_an_episode_is_played_again_with_the_settings_of_its_run(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["thin", "--detector", "oracle", "--controller", "mppc,open_loop", "--quiet", "--workers", "0"]
    words += ["--episodes", "1", "--set", "controller.gamma=2", "--set", "sensor.subpixel=0.1"]
    assert main([*words, "--out", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    for name in ("mppc", "open_loop"):  # gamma is no setting of open_loop, and was none of it then
        assert main(["replay", str(tmp_path / "run"), "--episode", "0", "--cell", f"oracle/{name}"]) == 0
        assert "configuration is another one" not in capsys.readouterr().out


def test_runs_are_compared_with_all_settings_that_differ(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    assert main(thin_command(a, episodes=1)) == 0
    assert main(thin_command(b, "--set", "sensor.subpixel=0.1", "--set", "ik.damping=1e-6", episodes=1)) == 0
    capsys.readouterr()
    main(["compare", str(a), str(b)])
    unlike = [line for line in capsys.readouterr().out.splitlines() if line.startswith("Not the same")]
    assert unlike == [
        "Not the same in both: thin.sensor.subpixel: 0.08 in A, 0.1 in B",
        "Not the same in both: thin.ik.damping: 1e-07 in A, 1e-06 in B",
    ]


def test_runs_with_and_without_noise_differ_in_that_alone(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    assert main(thin_command(a, episodes=1)) == 0
    assert main(thin_command(b, "--no-noise", episodes=1)) == 0
    capsys.readouterr()
    main(["compare", str(a), str(b)])
    unlike = [line for line in capsys.readouterr().out.splitlines() if line.startswith("Not the same")]
    assert unlike == ["Not the same in both: noise: true in A, false in B"]


def test_a_run_from_before_there_was_a_tree_is_compared_as_it_was(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    for out in (a, b):
        assert main(thin_command(out, episodes=1)) == 0
    run = json.loads((a / "run.json").read_text())
    del run["configuration"]["settings"]
    run["configuration"]["episode"]["camera_crop"] = 350
    (a / "run.json").write_text(json.dumps(run))
    capsys.readouterr()
    main(["compare", str(a), str(b)])
    assert "Not the same" not in capsys.readouterr().out

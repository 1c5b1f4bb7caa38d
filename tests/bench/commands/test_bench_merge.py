"""Shards that are played apart and merged are the run that one machine would have played."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import fakes
import pytest
from bench_runs import PLUG_INS, records, same_results, thin_command

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.playing.plan import Shard
from mpgrasp.bench.results.reader import read_run
from mpgrasp.exceptions import ConfigError

N = 3


@pytest.fixture
def whole(fake_world: object, tmp_path: Path) -> Path:
    """A run of 7 episodes of two controllers on one machine."""
    assert main(thin_command(tmp_path / "whole", episodes=7)) == 0
    return tmp_path / "whole"


@pytest.fixture
def shards(fake_world: object, tmp_path: Path) -> list[Path]:
    """The same run on three."""
    folders = [tmp_path / "shards" / str(k) for k in range(1, N + 1)]
    for k, folder in enumerate(folders, 1):
        assert main(thin_command(folder, "--shard", f"{k}/{N}", episodes=7)) == 0
    return folders


def merge(folders: list[Path], out: Path) -> int:
    return main(["merge", *map(str, folders), "--out", str(out)])


def test_merged_shards_are_the_run_that_one_machine_plays(
    whole: Path, shards: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "merged"
    assert merge(shards[::-1], out) == 0
    assert same_results(out, whole)
    assert read_run(out).configuration == read_run(whole).configuration
    assert (out / "report.html").is_file()
    assert f"Results: {out}" in capsys.readouterr().out
    assert main(["--resume", str(out)]) == 0  # its command plays the whole, of which nothing is missing
    assert same_results(out, whole)


def test_every_episode_is_in_one_shard_with_all_its_methods(shards: list[Path]) -> None:
    played = [{(row["episode"], row["controller"]) for row in records(folder)} for folder in shards]
    assert [sorted({episode for episode, _ in some}) for some in played] == [[0, 3, 6], [1, 4], [2, 5]]
    assert all(len(some) == 2 * len({episode for episode, _ in some}) for some in played)
    assert [read_run(folder).configuration.shard for folder in shards] == ["1/3", "2/3", "3/3"]


def test_what_is_missing_is_said_and_can_be_played(
    whole: Path, shards: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "merged"
    assert merge(shards[:2], out) == 1
    assert f"4 of 14 episodes are missing; --resume {out} plays them" in capsys.readouterr().err
    assert not json.loads((out / "summary.json").read_text())["complete"]
    assert main(["--resume", str(out)]) == 0
    assert same_results(out, whole)


def test_a_killed_shard_is_resumed_as_any_run(whole: Path, shards: list[Path], tmp_path: Path) -> None:
    file = shards[0] / "episodes.jsonl"
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:3]))
    (shards[0] / "summary.json").unlink()
    assert main(["--resume", str(shards[0])]) == 0
    assert merge(shards, tmp_path / "merged") == 0
    assert same_results(tmp_path / "merged", whole)


def test_tracebacks_come_along(fake_world: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", fakes.breaks_off)
    folders = [tmp_path / str(k) for k in (1, 2)]
    for k, folder in enumerate(folders, 1):
        words = ["thin", *PLUG_INS, "--quiet", "--episodes", "4", "--shard", f"{k}/2", "--out", str(folder)]
        assert main(words) in (0, 1)
    out = tmp_path / "merged"
    assert merge(folders, out) == 1
    errors = [row for row in records(out) if row["outcome"] == "error"]
    assert errors
    assert all("ZeroDivisionError" in (out / row["traceback"]).read_text() for row in errors)


def test_other_machines_are_told_in_run_json(
    shards: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    about = json.loads((shards[1] / "run.json").read_text())
    about["made_with"]["platform"] = "Another"
    (shards[1] / "run.json").write_text(json.dumps(about))
    merge(shards, tmp_path / "merged")
    assert "note: 1 of the parts were made with other versions" in capsys.readouterr().err
    run = read_run(tmp_path / "merged")
    assert [entry.made_with and entry.made_with.platform for entry in run.resumed] == ["Another", None]
    assert "--shard" not in run.command
    assert run.command.endswith(f"--out {tmp_path / 'merged'}")


def test_shards_that_do_not_belong_together_are_refused(
    whole: Path, shards: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(folders: list[Path], out: Path = tmp_path / "merged") -> str:
        assert merge(folders, out) == 2
        printed = capsys.readouterr().err
        assert printed.count("\n") == 1
        return printed

    other, half = tmp_path / "other", tmp_path / "half"
    main(thin_command(other, "--shard", "2/3", "--seed", "5", episodes=7))
    main(thin_command(half, "--shard", "2/2", episodes=7))
    again = Path(shutil.copytree(shards[0], tmp_path / "again"))
    capsys.readouterr()
    assert "a run that is no shard" in refused([shards[0], whole])
    assert "shard 1/3 twice" in refused([*shards, again])
    assert "shards of different runs (seed" in refused([shards[0], other])
    assert "shards of different sizes; got ['1/3', '2/2']" in refused([shards[0], half])
    assert "already holds another run" in refused(shards, other)
    file = shards[0] / "episodes.jsonl"
    file.write_text(file.read_text().replace('"episode": 3', '"episode": 4'))
    assert "is of no episode of shard 1/3; got 'episode 4 of thin" in refused(shards)
    assert not (tmp_path / "merged").exists()


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "1/0", "a/b", "1/2/3", "-1/3", "1.5/3", ""])
def test_a_shard_is_k_of_n(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ConfigError, match="unusable shard"):
        Shard.parse(text)
    assert main(["thin", f"--shard={text}"]) == 2
    assert "allowed: K/N with K from 1 to N, such as 3/16" in capsys.readouterr().err


def test_shards_cover_every_episode_once() -> None:
    for of in (1, 2, 7):
        shards = [Shard.parse(f"{k}/{of}") for k in range(1, of + 1)]
        assert [sum(shard.has(episode) for shard in shards) for episode in range(50)] == [1] * 50
        assert [str(shard) for shard in shards] == [f"{k}/{of}" for k in range(1, of + 1)]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--shard", "1/2", "--until-ci", "10"], "a shard cannot know the others' results"),
        (["--shard", "9/9", "--episodes", "8"], "a shard without an episode; got '9/9'; allowed: K up to 8"),
    ],
)
def test_what_shards_cannot_do_is_said(
    more: list[str], said: str, fake_world: object, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["thin", *PLUG_INS, *more]) == 2
    assert said in capsys.readouterr().err

"""Command lines that must be refused: each ends at once with one line on stderr and exit code 2.

They are played in a folder that `prepare` makes. Tests play them in their own process; a study can play them
as a user would, by `BadCommand.argv`.
"""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bad_numbers import BAD_NUMBERS
from bad_suites import BAD_SUITES
from mesh_writers import box, stl

HERE = Path(__file__).resolve().parent
RUN = HERE / "results" / "sticks-of-2mm" / "dhrnet"
"""A published run, whose first episodes become the run that commands are given."""
PACKAGES = ("bench", "evaluate", "offline", "scene", "detectors", "training", "view")
"""Programs that are `python -m mpgrasp.PROGRAM`; the others are scripts beside this file."""


@dataclass(frozen=True, kw_only=True)
class BadCommand:
    """One such command line."""

    line: str
    """Program and arguments, as one would type them; a program is one of `PACKAGES` or a script's name."""
    said: str
    """Words that stand in the line on stderr."""
    environment: Mapping[str, str] = field(default_factory=dict)

    @property
    def program(self) -> str:
        """Name of the program."""
        return shlex.split(self.line)[0]

    @property
    def arguments(self) -> list[str]:
        """Its arguments."""
        return [_LONG.get(word, word) for word in shlex.split(self.line)[1:]]

    def argv(self) -> list[str]:
        """Return the words of a process that plays it."""
        if self.program in PACKAGES:
            return [sys.executable, "-m", f"mpgrasp.{self.program}", *self.arguments]
        return [sys.executable, str(HERE / f"{self.program}.py"), *self.arguments]


def prepare(folder: Path) -> None:
    """Put all that the commands name into an empty folder."""
    (folder / "file").write_text("in the way")
    (folder / "folder").mkdir()
    (folder / "folder" / "thesis.tex").write_text("not to be lost")
    os.mkfifo(folder / "pipe")
    (folder / "box.stl").write_bytes(stl(box()))
    for run in (folder / "run", folder / "runs" / "one"):
        run.mkdir(parents=True)
        shutil.copy(RUN / "run.json", run)
        lines = (RUN / "episodes.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
        (run / "episodes.jsonl").write_text("".join(lines[:8]), encoding="utf-8")
    (folder / "broken").mkdir()
    (folder / "broken" / "run.json").write_text('{"format": ')
    (folder / "suites").mkdir()
    for name, (content, _) in BAD_SUITES.items():
        (folder / "suites" / f"{name}.toml").write_text(content, encoding="utf-8")
    (folder / "suites" / "bytes.toml").write_bytes(b"title = '\xff\xfe'\n")
    (folder / "suites" / "long.toml").write_text("title = 'x'\n" + "# much ado\n" * 200_000)
    os.mkfifo(folder / "suites" / "pipe.toml")
    (folder / "suites" / "endless.toml").symlink_to("/dev/zero")


_LONG = {
    "@digits": "9" * 5000,
    "@name": "x" * 300,
    "@grid": f"controller.gamma={','.join(map(str, range(40)))}",
    "@values": f"controller.alpha={','.join(str(k / 40) for k in range(40))}",
}
"""Words too long for a table."""
_REQUIRED = "the following arguments are required: "
_PATH = "unusable path; got ''; allowed: a name, or . for here"
_ABSENT = "(No such file or directory); got 'absent/"
_TAKEN = "File exists"
_FAST = "--detector oracle --controller open_loop"

_LINES: tuple[tuple[str, str], ...] = (
    ("bench thin --episodes @digits", "--episodes: unusable number; got '99999"),
    ("bench thin --max-episodes 20", "--max-episodes without --until-ci; got 20; allowed: --episodes"),
    ("bench thin --until-ci 10 --episodes 50 --max-episodes 20", "max-episodes out of range; got 20"),
    # what plays
    ("bench", f"{_REQUIRED}SUITE"),
    ("bench ''", "unknown suite; got ''"),
    ("bench thick", "unknown suite; got 'thick'; allowed: find_pile, find_stick, pile"),
    ("bench plan", f"{_REQUIRED}SUITE"),
    ("bench plan thin --out x", "plan with --out"),
    ("bench profile thin --runtime magic", "unknown runtime; got 'magic'"),
    ("bench ladder thick", "unknown ladder; got 'thick'; allowed: calibration"),
    ("bench ladder absent.toml", "unreadable ladder; got 'absent.toml'"),
    ("bench ladder suites/bytes.toml", "ladder is not valid TOML"),
    ("bench ladder thickness --shard 1/2", "a ladder with --shard"),
    ("bench ladders thick", "unknown ladder; got 'thick'"),
    ("bench race oracle/mppc --suite thin", "a race is of two methods"),
    ("bench race oracle/mppc oracle/mvp", f"{_REQUIRED}--suite"),
    ("bench race oracle/mppc oracle/mppc --suite thin", "a race of a method with itself"),
    ("bench race oracle/mppc oracle/mvp --suite thin --alpha 2", "unusable number; got '2'"),
    ("bench thin --runtime shared --engine ray", "--runtime shared with --engine ray"),
    ("bench leaderboard", f"{_REQUIRED}DIR"),
    ("bench leaderboard absent", "no run there"),
    ("evaluate", f"{_REQUIRED}dataset"),
    ("evaluate imagenet .", "invalid choice: 'imagenet'"),
    ("evaluate cornell absent", "no such folder; got 'absent'"),
    ("evaluate cornell folder", "no Cornell dataset; got 'folder'"),
    ("evaluate jacquard folder --limit 0", "unusable number; got '0'"),
    ("evaluate multi folder", "no multi-object dataset; got 'folder'"),
    ("evaluate synthetic folder", "no shards; got 'folder'"),
    ("evaluate frames folder", "no depth image; got 'folder'"),
    ("evaluate frames folder --focal -1", "unusable number; got '-1'"),
    ("evaluate cornell folder --split both", "invalid choice: 'both'"),
    ("evaluate cornell folder --train", "--train without --split"),
    ("evaluate cornell folder --train --split iw", "--train without --out"),
    ("evaluate cornell folder --fold 1", "--fold without --train; got 1"),
    (
        "evaluate cornell folder --train --split iw --out results --fold 6",
        "unusable --fold; got 6; allowed: 1 to --folds",
    ),
    ("evaluate cornell folder --epochs 3", "--epochs without --train; got 3"),
    ("evaluate cornell folder --settings '{\"width\":4}'", "--settings without --train"),
    ("evaluate cornell folder --folds 3", "--folds without --split; got 3"),
    ("evaluate cornell folder --depth perfect", "--depth without jacquard; got 'perfect'"),
    ("evaluate cornell folder --focal 500", "--focal without frames; got 500"),
    ("bench absent.toml", "unreadable suite; got 'absent.toml'"),
    ("bench suites/bytes.toml", "suite is not valid TOML"),
    ("bench suites/long.toml", "2 MB, more than 1 MB"),
    ("bench suites/pipe.toml", "it is a pipe or a device, no regular file"),
    ("bench suites/endless.toml", "it is a pipe or a device, no regular file"),
    ("bench thin unseen", "unrecognized arguments: unseen"),
    ("bench thin --bogus", "unrecognized arguments: --bogus"),
    ("bench thin --epis 3", "unrecognized arguments: --epis 3"),
    ("bench thin --detector ''", "unknown detector; got ''; allowed: dhrnet"),
    ("bench thin --detector resnet", "unknown detector; got 'resnet'; allowed: dhrnet"),
    ("bench thin --detector dhrnet,", "unknown detector; got ''"),
    ("bench thin --detector dhrnet,dhrnet", "unusable list of detectors; got 'dhrnet,dhrnet'"),
    ("bench thin --detector no_such_module:Net", "cannot be imported (ModuleNotFoundError"),
    ("bench thin --detector os:Net", "has no class 'Net'; got 'os:Net'"),
    ("bench thin --detector :", "has no such name; got ':'"),
    ("bench thin --controller ''", "unknown controller; got ''; allowed: mppc"),
    ("bench thin --controller pid", "unknown controller; got 'pid'"),
    ("bench thin --controller mppc,mppc", "unusable list of controllers; got 'mppc,mppc'"),
    ("bench thin --controller sb3:none.zip", "no such file of a policy; got 'none.zip'"),
    ("bench thin --controller no_such_module:Pid", "cannot be imported (ModuleNotFoundError"),
    ("bench thin --camera eye", "unknown camera backend; got 'eye'; allowed: auto, gl, ray"),
    ("bench thin --runtime abacus", "unknown runtime; got 'abacus'; allowed: auto, torch, openvino"),
    ("bench thin --weights absent.safetensors", "no such weights file; got 'absent.safetensors'"),
    ("bench thin --weights ''", "no such weights file"),
    ("bench thin --weights dhrnet=", "no such weights file"),
    ("bench thin --weights folder", "no such weights file; got 'folder'"),
    ("bench thin --weights pipe", "no such weights file; got 'pipe'"),
    ("bench thin --preset table9", "unknown preset; got 'table9'; allowed: table1"),
    ("bench paper --suites ''", "unknown suite of paper; got ''"),
    ("bench paper --suites thick", "unknown suite of paper; got 'thick'"),
    ("bench thin --suites thin", "--suites with a single suite"),
    ("bench thin --baseline robust", "--baseline says which controllers of a programme play"),
    ("bench paper --baseline strong", "invalid choice: 'strong' (choose from 'published', 'robust')"),
    # settings
    ("bench thin --set ''", "unusable --set; got ''"),
    ("bench thin --set controller.gamma", "unusable --set; got 'controller.gamma'"),
    ("bench thin --set =3", "unusable --set; got '=3'"),
    ("bench thin --set controler.gamma=1", "unknown group of settings; got 'controler'"),
    ("bench thin --set controller.gama=1", "setting controller.gama: no setting of mppc"),
    ("bench thin --set controller.gamma=", "--set controller.gamma is unusable; got ''"),
    ("bench thin --set controller.gamma=nan", "gamma is not finite; got nan"),
    ("bench thin --set controller.gamma=1e999", "gamma is not finite; got inf"),
    ("bench thin --set controller.gamma=1/0", "is unusable; got '1/0'"),
    ("bench thin --set camera.crop=0", "unusable crop of the camera; got 0"),
    ("bench thin --set camera.crop=1.5", "crop is unusable; got 1.5"),
    ("bench thin --set episode.start_jitter=-1", "start_jitter out of range; got -1.0; allowed: 0 to 0.5"),
    ("bench thin --set episode.max_reach_time=1e9", "max_reach_time out of range"),
    ("bench thin --set episode.control_dt=1e9", "control_dt out of range"),
    ("bench thin --set motion.dt=1e-9", "dt out of range; got 1e-09"),
    ("bench thin --set ik.damping=-1", "damping must not be negative; got -1.0"),
    ("bench thin --set scene.objects=[]", "a scene without objects"),
    ("bench thin --set scene.count=99", "too many objects; got 99"),
    ("bench thin --set sensor.subpixel=-1", "subpixel of the depth sensor; got -1.0"),
    ("bench settings thick", "unknown suite; got 'thick'"),
    ("bench settings thin --set controller.gama=1", "no setting of mppc"),
    ("bench settings thin --detector resnet", "unknown detector; got 'resnet'"),
    # folders
    ("bench thin --out ''", _PATH),
    ("bench thin --out ' '", "unusable path; got ' '"),
    (f"bench thin {_FAST} --out file", _TAKEN),
    (f"bench thin {_FAST} --out file/run", "Not a directory"),
    (f"bench thin {_FAST} --out folder", "directory is not empty and holds no run (thesis.tex)"),
    (f"bench thin {_FAST} --out run", "directory already holds another run"),
    (f"bench thin {_FAST} --out runs", "directory is not empty and holds no run (one)"),
    (f"bench thin {_FAST} --out @name", "File name too long"),
    ("bench --resume ''", _PATH),
    ("bench --resume absent", f"no run there {_ABSENT}run.json'"),
    ("bench --resume folder", "no run there (No such file"),
    ("bench --resume file", "no run there (Not a directory)"),
    ("bench --resume broken", "broken/run.json cannot be used"),
    ("bench --resume run --out other", "--out beside --resume"),
    ("bench single --scale 0.001", "--scale without --objects; got 0.001"),
    ("bench single --density 900", "--density without --objects; got 900.0"),
    ("bench thin --objects box.stl", "--objects with a suite that is made for its own objects"),
    ("bench paper --objects box.stl", "--objects with several suites"),
    ("bench single --objects ''", "no such file or folder of objects; got ''"),
    ("bench single --objects absent.stl", "no such file or folder of objects; got 'absent.stl'"),
    ("bench single --objects folder", "no mesh in folder; got 'folder'"),
    ("bench single --objects pipe --workers 0 --quiet", "a pipe or a device"),
    # other commands
    ("bench sweep", f"{_REQUIRED}SUITE"),
    ("bench sweep thin", "a sweep has no setting with several values"),
    ("bench sweep thin --set controller.gamma=0,nan", "gamma is not finite; got nan"),
    ("bench sweep thin --set controller.gamma=0,0", "has a value twice; got '0'"),
    ("bench sweep thin --set @grid --set @values", "too many points in the grid of a sweep; got 1600"),
    ("bench sweep paper --set controller.gamma=0,1", "a sweep of several suites"),
    ("bench compare run", f"{_REQUIRED}B"),
    ("bench compare absent run", f"no episodes there {_ABSENT}episodes.jsonl'"),
    ("bench compare run file", "no episodes there (Not a directory)"),
    ("bench compare run/dhrnet/pid run", "no such cell; got 'dhrnet/pid'"),
    ("bench export", f"{_REQUIRED}RUN, --out"),
    ("bench export absent --out new", f"no run there {_ABSENT}run.json'"),
    ("bench export broken --out new", "broken/run.json cannot be used"),
    ("bench export run --cell dhrnet/pid --out new", "no such cell; got 'dhrnet/pid'"),
    ("bench export run --format zarr --out new", "invalid choice: 'zarr'"),
    ("bench export run --cell dhrnet/mppc --out run", "there is something already; got 'run'"),
    ("bench replay", f"{_REQUIRED}RUN, --episode"),
    ("bench replay absent --episode 0", f"no run there {_ABSENT}run.json'"),
    ("bench replay broken --episode 0", "broken/run.json cannot be used"),
    ("bench replay run --episode 0 --cell dhrnet/pid", "no such cell; got 'dhrnet/pid'"),
    ("bench report", f"{_REQUIRED}DIR"),
    ("bench report ''", _PATH),
    ("bench report absent", f"no run there {_ABSENT}run.json'"),
    ("bench report run --out file", _TAKEN),
    ("scene", f"{_REQUIRED}SUITE"),
    ("scene thick", "unknown suite; got 'thick'"),
    ("scene thin --out ''", _PATH),
    ("scene thin --out folder", "cannot write the scene; got 'folder'"),
    ("scene thin --out file/scene.xml", _TAKEN),
    ("scene thin --out @name", "File name too long"),
    ("detectors", f"{_REQUIRED}show|check|card|graph"),
    ("view thick", "unknown suite; got 'thick'"),
    ("view thin --out a --every nan", "argument --every: unusable number; got 'nan'"),
    ("view thin --out a --detector nobody", "unknown detector; got 'nobody'"),
    ("offline nowhere", "a file of a recording cannot be read (No such file"),
    ("offline nowhere --controller pid", "a file of a recording cannot be read (No such file"),
    ("detectors show resnet", "unknown detector; got 'resnet'"),
    ("detectors show oracle --out picture.txt", "unknown kind of recording; got 'picture.txt'"),
    ("detectors show oracle --out file/picture.png", _TAKEN),
    ("detectors show oracle --above-object unicorn", "no such object in this scene; got 'unicorn'"),
    ("detectors show oracle --camera eye", "unknown camera backend; got 'eye'"),
    ("detectors check oracle", "a detector without a runtime; got 'oracle'"),
    ("detectors check dhrnet --weights absent", "no such weights file; got 'absent'"),
    ("detectors card resnet", "unknown detector; got 'resnet'"),
    ("detectors graph resnet", "unknown network; got 'resnet'"),
    ("detectors graph ggcnn2 --weights absent", "no such weights file; got 'absent'"),
    ("detectors graph ggcnn2 --out file/ggcnn2.graph", "a graph cannot be written: "),
    ("training", f"{_REQUIRED}generate|train"),
    ("training generate", f"{_REQUIRED}--out"),
    ("training generate --out data --camera eye", "invalid choice: 'eye'"),
    ("training generate --out file --scenes 1", _TAKEN),
    ("training calibrate", f"{_REQUIRED}name, --data"),
    ("training calibrate resnet --data folder", "resnet"),
    ("training calibrate fcn --data folder", "no such weights file"),
    ("training calibrate dhrnet --weights absent --data folder", "no such weights file; got 'absent'"),
    ("training calibrate dhrnet --data absent", "no training images; got ['absent']"),
    ("training calibrate dhrnet --data ''", _PATH),
    ("training train", f"{_REQUIRED}name, --data"),
    ("training train resnet --data folder", "unknown network; got 'resnet'"),
    ("training train dhrnet --data ''", _PATH),
    ("training train dhrnet --data absent", "no training images; got ['absent']"),
    ("training train dhrnet --data folder --average 1", "unusable average; got 1.0"),
    ("training train dhrnet --data folder --schedule moon", "unknown schedule; got 'moon'"),
    ("training train dhrnet --data folder --precision int2", "unknown precision; got 'int2'"),
    ("training train dhrnet --data folder --settings {", "settings are not JSON"),
    ("training train dhrnet --data folder --settings []", "settings are not a JSON object"),
    # studies
    ("ablation", f"{_REQUIRED}study"),
    ("ablation seasons", "invalid choice: 'seasons'"),
    ("ablation architecture --data absent", "not enough images; got '0 in absent'"),
    ("across --offline absent", "no rates of single views: "),
    ("across --offline folder --ladder absent", "no rates of single views: "),
    ("across --seed -1", "argument --seed: unusable number; got '-1'"),
    ("across --out file/across", "results cannot be written: "),
    ("ceiling thin --episodes x", "unusable episodes; got 'x'"),
    ("controller_factors --thickness nan", "unusable thickness; got nan; allowed: above 0"),
    ("controller_factors --thickness 2,inf", "unusable thickness; got inf; allowed: above 0"),
    ("generated_splits --data absent", "no such folder; got 'absent'"),
    ("generated_splits --channels d,xyz", "unusable inputs; got 'd,xyz'"),
    ("generated_splits --folds 1", "unusable number; got '1'"),
    ("picture --bogus", "unrecognized arguments: --bogus"),
    ("picture --out ''", _PATH),
    ("picture --out file/episode.png", _TAKEN),
    ("run_time --network resnet", "unknown network; got 'resnet'"),
    ("same_bits thick", "unknown suite; got 'thick'"),
    ("same_bits --controller pid", "unknown controller; got 'pid'"),
    ("same_bits --settings blas", "unknown settings; got ['blas']; allowed: reference, blas-haswell"),
    ("table --bogus", "unrecognized arguments: --bogus"),
    ("thickness --camera eye", "invalid choice: 'eye'"),
    ("thickness --detector oracle --out file", _TAKEN),
)
"""Line, and words of what is said."""


def _numbers() -> dict[str, BadCommand]:
    found = {}
    for command, option, values, allowed in BAD_NUMBERS:
        for value in values:
            line = f"{command} {option} {shlex.quote(value)}"
            said = f"argument {option}: unusable number; got {value!r}; allowed: {allowed}"
            found[line] = BadCommand(line=line, said=said)
    return found


_GL = (
    ("banana", "unusable environment variable MUJOCO_GL; got 'banana'; allowed: egl"),
    ("osmesa", "MUJOCO_GL asks for OSMesa, which is not installed"),
)

BAD_COMMANDS: dict[str, BadCommand] = {
    **_numbers(),
    **{line: BadCommand(line=line, said=said) for line, said in _LINES},
    **{
        f"bench suites/{name}.toml": BadCommand(line=f"bench suites/{name}.toml", said=said)
        for name, (_, said) in BAD_SUITES.items()
    },
    **{
        f"MUJOCO_GL={value} {program} thin": BadCommand(
            line=f"{program} thin", said=said, environment={"MUJOCO_GL": value}
        )
        for value, said in _GL
        for program in ("bench", "scene")
    },
}
"""The command lines by name."""

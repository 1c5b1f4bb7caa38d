"""Laws of the registry: a network is one file and one line, and knowing the names costs nothing."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch

import mpgrasp
from mpgrasp.detectors import DETECTORS
from mpgrasp.detectors.networks.declaration import HEADS
from mpgrasp.detectors.networks.registry import NETWORKS, build_network, declaration
from mpgrasp.exceptions import ConfigError

PACKAGE = Path(mpgrasp.__file__).parent

TOY = """
from dataclasses import dataclass

from torch import nn

from mpgrasp.detectors.networks.declaration import NetworkDeclaration, PublishedWeights


@dataclass(frozen=True, kw_only=True)
class ToyConfig:
    channels: int = 1


class Toy(nn.Module):
    def __init__(self, config):
        super().__init__()
        self.config, self.only = config, nn.Conv2d(config.channels, 4, 1)

    def forward(self, x):
        return self.only(x).split(1, dim=1)


DECLARATIONS = {
    "toy": NetworkDeclaration(
        network=Toy, config=ToyConfig, source="nowhere", input_size=96, variants={"tiny": {}},
        published=PublishedWeights(entry="only.weight", width_px=7.0, card={"licence": "none"}),
    )
}
"""

USE = """
import json, sys
from pathlib import Path

import numpy as np
import torch

from mpgrasp.detectors import make_detector
from mpgrasp.detectors.networks.cost import variants
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.plugins import detector_names
from mpgrasp.training.train import add_arguments, config_from
from mpgrasp.command_line import Parser

folder = Path(sys.argv[1])
torch.save(build_network("toy", {}).state_dict(), folder / "toy.pt")
detector = make_detector("toy", folder / "toy.pt", "torch")
parser = Parser()
add_arguments(parser)
print(json.dumps({
    "detector": "toy" in detector_names(),
    "map": detector.grasp_arrays(np.zeros((96, 96), np.float32))[0].shape,
    "width_px": detector.weights.width_px,
    "trained at": config_from(parser.parse_args(["toy", "--data", "d"])).input.size,
    "in the help": "toy" in parser.format_help(),
    "in the table": ["toy", "tiny", {}] in [list(row) for row in variants()],
}))
"""


def test_a_network_is_added_by_one_file_and_one_line(tmp_path: Path) -> None:
    copy = tmp_path / "mpgrasp"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "detectors" / "networks" / "toy.py").write_text(TOY)
    registry = copy / "detectors" / "networks" / "registry.py"
    names, line = "NETWORKS: dict[str, str] = {\n", '    "toy": "mpgrasp.detectors.networks.toy",\n'
    before = registry.read_text()
    assert before.count(names) == 1
    registry.write_text(before.replace(names, names + line))
    done = subprocess.run(
        [sys.executable, "-c", USE, str(tmp_path)],
        capture_output=True, text=True, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {
        "detector": True, "map": [96, 96], "width_px": 7.0, "trained at": 96, "in the help": True,
        "in the table": True,
    }  # fmt: skip


@pytest.mark.parametrize("name", NETWORKS)
def test_a_declaration_is_all_that_there_is_to_know_of_a_network(name: str) -> None:
    declared = declaration(name)
    assert declared.source
    for settings in declared.variants.values():
        with torch.device("meta"):
            network = declared.build({**settings, "channels": 4})
        # one that is not trained by its maps need not have heads
        assert {f"{head}_output.weight" for head in HEADS} <= set(network.state_dict()) or declared.loss
    if declared.published is not None:
        with torch.device("meta"):
            tensors = {other: build_network(other, {}).state_dict() for other in NETWORKS}
        # names of its own, where its tensors are called otherwise here
        own = [] if declared.published.read else [name]
        assert [other for other in NETWORKS if declared.published.entry in tensors[other]] == own


def test_every_network_is_a_detector() -> None:
    assert tuple(DETECTORS) == (*NETWORKS, "heuristic", "oracle")


def test_an_unknown_network_is_refused_with_the_names() -> None:
    for ask in (declaration, lambda name: build_network(name, {})):
        with pytest.raises(ConfigError, match=r"resnet.*dhrnet, tfgrasp, ggcnn, ggcnn2"):
            ask("resnet")


def test_knowing_the_names_loads_no_torch() -> None:
    code = "import sys, mpgrasp.detectors.networks.registry; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"

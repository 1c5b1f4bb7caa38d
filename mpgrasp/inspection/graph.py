"""`python -m mpgrasp.detectors graph`: with the graph of a network its weights need no torch."""

from __future__ import annotations

import argparse
from pathlib import Path

from mpgrasp.detectors.networks.registry import check_network, default_weights
from mpgrasp.detectors.runtimes.compiled import read_in_torch
from mpgrasp.detectors.runtimes.graph import SUFFIX, Graph, write_graph
from mpgrasp.detectors.runtimes.openvino import openvino, openvino_precision
from mpgrasp.exceptions import ConfigError


def run(options: argparse.Namespace) -> int:
    """Write the graph of a network; return the exit code."""
    weights = options.weights or default_weights(options.detector)
    file = options.out or weights.with_suffix(SUFFIX)
    graph = graph_of(options.detector, weights)
    write_graph(file, graph)
    print(f"{file}: {len(graph.facts.tensors)} tensors, {file.stat().st_size / 1e3:.0f} kB")
    return 0


def graph_of(name: str, weights: Path) -> Graph:
    """Return the graph of the network that a weights file is of.

    Raises:
        ConfigError: there is no such network, no torch or no OpenVINO.
        WeightsError: the file is missing, unreadable or another network's.
    """
    check_network(name)
    if openvino_precision() is None:
        raise ConfigError("a graph is made by OpenVINO", allowed="pip install openvino")
    read = read_in_torch(name, weights)
    from mpgrasp.detectors.runtimes.graph_making import make_graph

    return make_graph(read, openvino())

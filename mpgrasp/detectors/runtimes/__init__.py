"""Runtimes, which compute a network: torch or OpenVINO, here or in a server. Importing this loads neither."""

SHARED = "shared"
"""The fastest runtime, in one process that serves all workers; see `mpgrasp.detectors.runtimes.server`."""
RUNTIMES = ("auto", "torch", "openvino", SHARED)
"""Names of the runtimes; see `mpgrasp.detectors.runtimes.runtime`."""

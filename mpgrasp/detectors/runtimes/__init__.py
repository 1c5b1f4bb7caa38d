"""Runtimes, which compute a network: torch or OpenVINO. Importing this package loads neither."""

RUNTIMES = ("auto", "torch", "openvino")
"""Names of the runtimes; see `mpgrasp.detectors.runtimes.runtime`."""

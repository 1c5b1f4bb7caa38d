"""What is told of the processor and of the BLAS that numpy uses on it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mpgrasp.bench.results import processor
from mpgrasp.bench.results.provenance import provenance


def test_the_processor_is_named_as_the_system_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = tmp_path / "cpuinfo"
    told.write_text("processor\t: 0\nmodel name\t: A Fine Processor @ 2 GHz\nmodel name\t: another\n")
    monkeypatch.setattr(processor, "_CPU_INFO", told)
    assert processor.processor() == "A Fine Processor @ 2 GHz"
    assert provenance().processor == "A Fine Processor @ 2 GHz"


def test_a_system_that_does_not_tell_its_processor_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processor, "_CPU_INFO", tmp_path / "missing")
    monkeypatch.setattr("platform.processor", lambda: "")
    assert processor.processor() == ""
    assert "processor" not in provenance().as_row()


def test_the_instruction_sets_are_those_of_numpy() -> None:
    assert processor.instruction_sets()
    assert all(isinstance(name, str) for name in processor.instruction_sets())


@pytest.mark.skipif("X86_V3" not in processor.instruction_sets(), reason="a processor with one kernel alone")
@pytest.mark.skipif(not any("openblas" in name for name in processor.blas_kernels()), reason="no OpenBLAS")
def test_kernels_are_told_apart() -> None:
    assert len({told("Prescott"), told("Haswell")}) == 2


def told(kernel: str) -> str:
    program = "from mpgrasp.bench.results.processor import blas_kernels; print(*blas_kernels())"
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel}
    command = [sys.executable, "-c", program]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout

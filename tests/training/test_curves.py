"""Laws of the curves on disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from mpgrasp.exceptions import OutputError
from mpgrasp.training.curves import write_curves


def test_curves_that_cannot_be_written_are_one_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="curves"):
        write_curves(tmp_path / "file" / "w.csv", [{"images": 1.0}])

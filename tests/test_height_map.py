"""A height map's arrays belong together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from height_maps import height_map

from mpgrasp.exceptions import ConfigError


def test_maps_of_different_sizes_are_refused() -> None:
    truth = height_map()
    for name in ("height", "support", "label"):
        with pytest.raises(ConfigError, match="differ in size"):
            replace(truth, **{name: getattr(truth, name)[1:]})
    with pytest.raises(ConfigError, match="differ in size"):
        replace(truth, height=np.zeros(3), support=np.zeros(3), label=np.zeros(3, int))


@pytest.mark.parametrize("changes", [{"cell": 0.0}, {"cell": -0.002}, {"cell": np.nan}, {"x0": np.inf}])
def test_a_place_or_cell_that_is_none_is_refused(changes: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="place or cell"):
        replace(height_map(), **changes)  # type: ignore[arg-type]

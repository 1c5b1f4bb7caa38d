"""Objects for the table: the catalogue of the benchmark, and objects from mesh files."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

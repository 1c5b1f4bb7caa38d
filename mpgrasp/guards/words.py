"""Words for a value that cannot be used, so that an error says what came."""

from __future__ import annotations

import numpy as np

TENSOR_REMEDY = "a numpy array: tensor.detach().cpu().numpy()"
"""How a tensor of torch becomes what is allowed."""


def owner(kind: str, plug_in: object) -> str:
    """Return "detector NAME" or "controller NAME", by the name that it gives itself, else by its class."""
    name = getattr(plug_in, "name", None)
    return f"{kind} {name if isinstance(name, str) and name else type(plug_in).__name__}"


def is_tensor(value: object) -> bool:
    """True for a tensor of torch; does not import torch."""
    return type(value).__module__.partition(".")[0] == "torch" and hasattr(value, "detach")


def described(value: object) -> str:
    """Return type, size and range of a value in a few words: "float32 (224, 224) from -3.1 to 5.2"."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape}{_range(value)}"
    if is_tensor(value):
        kind, shape = str(getattr(value, "dtype", "")), tuple(getattr(value, "shape", ()))
        return f"{kind.replace('torch.', 'torch tensor ')} {shape} on {getattr(value, 'device', '?')}"
    if value is None or isinstance(value, bool | int | float | str | np.generic):
        return repr(value)
    return f"an object of type {type(value).__name__}"


def _range(array: np.ndarray) -> str:
    if array.dtype.kind not in "iuf" or not array.size:
        return ""
    if array.size <= 6 and array.ndim == 1:
        return f" = {[round(float(x), 6) for x in array]}"
    finite = array[np.isfinite(array)]
    if not finite.size:
        return ", none of it finite"
    lost = array.size - finite.size
    return f" from {finite.min():.4g} to {finite.max():.4g}" + (f", {lost} not finite" if lost else "")

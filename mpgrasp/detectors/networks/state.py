"""Tensors of a state dict: their forms, and the forms that a network needs before any of them is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.overrides import TorchFunctionMode

from mpgrasp.detectors.networks.entries import Entry
from mpgrasp.detectors.networks.registry import build_network


def entries(state: Mapping[str, Tensor]) -> dict[str, Entry]:
    """Return the forms of a state dict's tensors."""
    return {
        key: Entry(tuple(value.shape), str(value.dtype).removeprefix("torch."))
        for key, value in state.items()
    }


def numbers(state: Mapping[str, Tensor]) -> dict[str, NDArray[Any]]:
    """Return a state dict's tensors as arrays; those of 16 bits in single precision, which is exact."""
    return {
        key: (value.float() if value.is_floating_point() else value).detach().cpu().numpy()
        for key, value in state.items()
    }


def needed_entries(name: str, settings: Mapping[str, Any]) -> dict[str, Entry]:
    """Return the forms of the tensors that a network needs, however large; it is built without memory."""
    with torch.device("meta"), _Unfilled():
        return entries(build_network(name, settings).state_dict())


class _Unfilled(TorchFunctionMode):
    """Leaves out first weights, which tensors without memory cannot hold and torch takes long to skip."""

    def __torch_function__(
        self, func: Any, types: Any, args: Sequence[Any] = (), kwargs: Mapping[str, Any] | None = None
    ) -> Any:
        kwargs = kwargs or {}
        if getattr(func, "__module__", None) == "torch.nn.init" or func in (Tensor.normal_, Tensor.uniform_):
            return kwargs["tensor"] if "tensor" in kwargs else args[0]
        return func(*args, **kwargs)

"""Transposed convolutions that train fast in bfloat16 on a CPU."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F


class PhasedTranspose(nn.ConvTranspose2d):
    """A transposed convolution that a CPU trains in bfloat16 as an ordinary one, phase by phase.

    With a stride of s every s-th row and column of the output sees its own part of the kernel, so that one
    convolution makes all s * s of them (Shi et al. 2016, https://arxiv.org/abs/1609.05158, Section 3.2).
    PyTorch trains that several times as fast in bfloat16 on a CPU, though not in float32; weights are the
    same, outputs up to rounding.

    Args:
        inputs: channels of the input.
        outputs: channels of the output.
        kernel: side of the kernel.
        stride: of rows and columns alike.
        padding: rows and columns that are cut off on each side.
        output_padding: rows and columns more at the end.
    """

    def __init__(
        self, inputs: int, outputs: int, kernel: int, *, stride: int, padding: int, output_padding: int
    ) -> None:
        super().__init__(
            inputs, outputs, kernel, stride=stride, padding=padding, output_padding=output_padding
        )

    def forward(self, x: Tensor, output_size: list[int] | None = None) -> Tensor:
        slow = self.training and x.dtype is torch.bfloat16 and x.device.type == "cpu"
        return self.phased(x) if slow and output_size is None else super().forward(x, output_size)

    def phased(self, x: Tensor) -> Tensor:
        """Return what `forward` does, (n, outputs, H', W') for (n, inputs, H, W), by one convolution."""
        side, stride, cut = int(self.kernel_size[0]), int(self.stride[0]), int(self.padding[0])
        taps = -(-side // stride)  # of each phase
        whole = F.pad(self.weight, (0, taps * stride - side) * 2)
        phases = [whole[:, :, a::stride, b::stride].flip(2, 3) for a in range(stride) for b in range(stride)]
        kernel = torch.stack(phases, 2).permute(1, 2, 0, 3, 4).flatten(0, 1)
        bias = None if self.bias is None else self.bias.repeat_interleave(len(phases))
        full = F.pixel_shuffle(F.conv2d(x, kernel, bias, padding=taps - 1), stride)
        more = side - stride - 2 * cut + int(self.output_padding[0])
        height, width = (stride * size + more for size in x.shape[-2:])
        part = full[..., cut : cut + height, cut : cut + width]
        return part.contiguous(memory_format=torch.channels_last)  # as the trainer has its images

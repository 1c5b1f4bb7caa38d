"""Description of a weights file, as its metadata tell it: checked like any other input before it is used."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open

from mpgrasp.detectors.networks.calibration import Calibration
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import NETWORKS, declaration
from mpgrasp.exceptions import ConfigError, WeightsError
from mpgrasp.files.settings import from_table

FORMAT = "mpgrasp-weights-1"
MAX_WIDTH_SHARE = 4.0
"""Most that a width output of 1 may stand for, in units of the image's side."""
MAX_TEXT = 2**20
"""Longest text that metadata may hold, in characters."""

_SHOWN = 80  # characters of a value in an error
_BEGINNINGS = {
    b"": "an empty file",
    b"PK\x03\x04": "a PyTorch file (published state dicts end in .pt or .pth) or another zip",
    b"\x80": "a pickle",
    b"version https://git-lfs": "a Git LFS pointer: the file itself was not downloaded",
    b"\x89HDF": "an HDF5 file",
}


@dataclass(frozen=True, kw_only=True)
class WeightsDescription:
    """Facts that a weights file tells about itself."""

    network: str
    """Name in the registry of networks."""
    settings: Any
    """Keyword arguments of the network's config, as they were stored."""
    input: NetworkInput
    width_px: float
    """Opening that a width output of 1 stands for, in pixels of the network's image [px]."""
    card: Mapping[str, Any]
    """Training card."""
    calibration: Calibration | None = None
    """Of the claimed quality; None where nobody has measured it."""


def read_header(path: Path | str) -> WeightsDescription:
    """Return the description of a weights file, without a look at its network: needs no torch.

    Raises:
        WeightsError: the file is unreadable, of another make, or says what cannot be.
    """
    with opened(path) as file:
        metadata = file.metadata() or {}
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            f"{path}: not a weights file of mpgrasp",
            got=shown(metadata.get("format", "no format")),
            allowed=f"safetensors with format {FORMAT}",
        )
    name = metadata.get("network", "no name")
    if name not in NETWORKS:
        raise WeightsError(f"{path}: weights of an unknown network", got=shown(name), allowed=NETWORKS)
    settings, image, width_px, card = (
        _value(path, metadata, key) for key in ("settings", "input", "width_px", "card")
    )
    if not isinstance(card, dict):
        raise WeightsError(f"{path}: a training card that is no table", got=shown(card), allowed="a table")
    scale = _value(path, metadata, "calibration") if "calibration" in metadata else None
    with _told_of(path):
        presented = from_table(NetworkInput, _without_range_channel(image), "input")
        calibration = None if scale is None else from_table(Calibration, scale, "calibration")
    _check_width(path, width_px, presented.size)
    return WeightsDescription(
        network=name,
        settings=settings,
        input=presented,
        width_px=float(width_px),
        card=card,
        calibration=calibration,
    )


def read_description(path: Path | str) -> WeightsDescription:
    """Return the description of a weights file, all of it checked.

    Raises:
        WeightsError: the file is unreadable, of another make, or says what cannot be.
    """
    about = read_header(path)
    with _told_of(path):
        config = from_table(declaration(about.network).config, about.settings, "settings")
    _check_sizes(path, about.network, config, about.input)
    return about


def read_card(path: Path | str) -> dict[str, Any]:
    """Return all that a weights file says about itself: network, settings, input, unit of width, card,
    calibration.

    Raises:
        WeightsError: the file is unreadable, of another make, or says what cannot be.
    """
    about = read_description(path)
    return {
        "network": about.network,
        "settings": about.settings,
        "input": asdict(about.input),
        "width_px": about.width_px,
        "card": about.card,
        "calibration": None if about.calibration is None else asdict(about.calibration),
    }


def check_weights_file(file: Path) -> Path:
    """Return the path of a weights file; WeightsError if there is none."""
    if not file.is_file():
        raise WeightsError("no such weights file", got=str(file), allowed="a .safetensors, .pt or .pth file")
    return file


def check_name(about: WeightsDescription, name: str, path: Path | str) -> None:
    """Raise WeightsError unless weights are those of a network."""
    if about.network != name:
        raise WeightsError(
            f"{path}: weights of another network, not of {name}", got=about.network, allowed=name
        )


@contextmanager
def opened(path: Path | str, framework: str = "np") -> Iterator[Any]:
    """Give a safetensors file, open; its tensors are numpy's, or torch's with "pt".

    Raises:
        WeightsError: the file is unreadable or not safetensors.
    """
    try:
        with safe_open(path, framework=framework) as file:
            yield file
    except (OSError, SafetensorError) as error:
        raise WeightsError(
            f"{path}: weights cannot be read: {error}", got=_kind(path), allowed="a whole safetensors file"
        ) from error


def shown(value: object, most: int = _SHOWN) -> object:
    """Return a value for an error: itself, or the beginning of a long one."""
    text = value if isinstance(value, str) else repr(value)
    return value if len(text) <= most else text[:most] + "..."


@contextmanager
def _told_of(path: Path | str) -> Iterator[None]:
    """Say of which file it is what a config refuses."""
    try:
        yield
    except ConfigError as error:
        raise WeightsError(f"{path}: {shown(str(error), 4 * _SHOWN)}") from error


def _value(path: Path | str, metadata: Mapping[str, str], key: str) -> Any:
    """Return a JSON value of the metadata; NaN and infinities are none."""
    text = metadata.get(key)
    if text is None or len(text) > MAX_TEXT:
        got = "nothing" if text is None else f"{len(text)} characters"
        raise WeightsError(f"{path}: unusable {key}", got=got, allowed=f"JSON of up to {MAX_TEXT} characters")
    try:
        value = json.loads(text)
        json.dumps(value, allow_nan=False)
    except (ValueError, RecursionError) as error:
        raise WeightsError(
            f"{path}: {key} is no JSON of finite numbers ({error})", got=shown(text), allowed="JSON"
        ) from error
    return value


def _without_range_channel(image: Any) -> Any:
    """Return the input's table without the key that files from before colour have, where it says false."""
    if isinstance(image, dict) and image.get("range_channel") is False:
        return {key: value for key, value in image.items() if key != "range_channel"}
    return image


def _check_width(path: Path | str, width_px: object, size: int) -> None:
    most = MAX_WIDTH_SHARE * size
    if isinstance(width_px, bool) or not isinstance(width_px, int | float) or not 0 < width_px <= most:
        raise WeightsError(
            f"{path}: weights with a wrong unit of width",
            got=shown(width_px),
            allowed=f"above 0, up to {most:g} px",
        )


def _check_sizes(path: Path | str, name: str, config: Any, image: NetworkInput) -> None:
    """Raise WeightsError if the network was not made for such an input."""
    if config.channels != image.channels:
        raise WeightsError(
            f"{path}: weights with a wrong number of channels",
            got=config.channels,
            allowed=str(image.channels),
        )
    if getattr(config, "size", image.size) != image.size:
        raise WeightsError(
            f"{path}: weights for images of another size", got=config.size, allowed=str(image.size)
        )
    unit = declaration(name).multiple_of
    if image.size % unit:
        raise WeightsError(
            f"{path}: images of a size that {name} does not keep",
            got=image.size,
            allowed=f"multiples of {unit}",
        )


def _kind(path: Path | str) -> str:
    """Return what a file seems to be, by its beginning."""
    try:
        with Path(path).open("rb") as file:
            beginning = file.read(32)
    except OSError as error:
        return f"a file that cannot be read ({error.strerror})"
    found = [kind for start, kind in _BEGINNINGS.items() if start and beginning.startswith(start)]
    return found[0] if found else "something else, or a part" if beginning else _BEGINNINGS[b""]

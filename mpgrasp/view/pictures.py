"""An episode as pictures, for where there is no display: the scene, the camera's depth and the maps."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.recording.film import FilmConfig, FilmRecorder

if TYPE_CHECKING:
    from mpgrasp.scene.simulation import Simulation


class Pictures(FilmRecorder):
    """Writes a PNG of an episode every so often, and one of its end.

    Args:
        folder: made if need be; the files are called 0000.png and so on.
        every: time from one to the next [s].
        camera: backend of the watching camera: "gl", "ray" or "auto".

    Raises:
        ConfigError: a time that is not above 0.
        OutputError: once it starts, the folder cannot be made or written to.
        CameraError: backend "gl" without GL.
    """

    def __init__(self, folder: Path, every: float = 1.0, camera: str = "auto") -> None:
        if not 0 < every < np.inf:
            raise ConfigError("unusable time between pictures", got=every, allowed="above 0 [s]")
        super().__init__(config=FilmConfig(backend=camera))
        self.folder, self._every = folder, every
        self.files: list[Path] = []
        """Written so far."""

    def start(self, simulation: Simulation) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"no folder for pictures ({error.strerror})", got=str(self.folder)) from error
        super().start(simulation)

    def finish(self, event: str) -> None:
        """Write the pictures.

        Raises:
            OutputError: the disk does not take them.
        """
        super().finish(event)
        times = np.array(self.times)
        due = np.arange(times[0], times[-1], self._every)
        chosen = sorted({*np.searchsorted(times, due - 1e-9).tolist(), len(times) - 1})
        for k, index in enumerate(chosen):
            file, content = self.folder / f"{k:04d}.png", io.BytesIO()
            Image.fromarray(self.pictures[index]).save(content, "PNG")
            try:
                replace_file(file, content.getvalue())
            except OSError as error:
                raise OutputError(f"a picture cannot be written ({error.strerror})", got=str(file)) from error
            self.files.append(file)

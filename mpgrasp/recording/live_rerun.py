"""An episode in the rerun viewer while it is played."""

from __future__ import annotations

import rerun as rr

from mpgrasp.exceptions import ConfigError
from mpgrasp.recording.rerun import RerunRecorder, make_blueprint


class LiveRerun(RerunRecorder):
    """Streams what `RerunRecorder` writes to a viewer, and keeps no file.

    Args:
        address: of a viewer that runs, "rerun+http://HOST:PORT/proxy"; None starts one here.

    Raises:
        ConfigError: a viewer can be neither started nor reached.
    """

    def __init__(self, address: str | None = None) -> None:
        self._stream = rr.RecordingStream("mpgrasp", recording_id=None)
        try:
            if address is None:
                self._stream.spawn()
            else:
                self._stream.connect_grpc(address)
        except (RuntimeError, ValueError, OSError) as error:
            raise ConfigError(
                f"no viewer of rerun ({error})", got=address, allowed="rerun+http://127.0.0.1:9876/proxy"
            ) from error
        self._stream.send_blueprint(make_blueprint(), make_active=True)
        self._begin()

    def finish(self, event: str) -> None:
        self._stream.log("events", rr.TextLog(event, level="INFO"))
        self._stream.flush()
        self._stream.disconnect()

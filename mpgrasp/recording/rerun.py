"""An episode as a recording for the rerun viewer (https://rerun.io), laid out when it opens."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from mpgrasp.depth import DepthFrame, crop_resize
from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.geometry import FloatArray, transform_points
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.recording.false_colour import shade, shade_lines
from mpgrasp.recording.recorder import TickRecord, claim_file
from mpgrasp.recording.rerun_model import RerunModel

if TYPE_CHECKING:
    from mpgrasp.scene.simulation import Simulation

TIMELINE = "sim_time"
FLUSH_LIMIT = 60.0
"""Wall-clock time that rerun may take to encode what it was given [s]; usually well below one."""

_DEPTH_UNITS = 4000.0  # depth images in quarters of a millimetre, below the sensor's own steps
_IMAGE_SIZE = 224  # [px], larger depth images are cropped and reduced to this
_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 85]
_WIDEST = 0.10  # [m], full scale of the width map
_FINGER_LENGTH = 0.05  # [m], of the drawn grasp
_GRASP_COLOUR = (255, 80, 0)
_AXES = ("x", "y", "z")


class RerunRecorder:
    """Writes one episode to an .rrd file.

    Entities: `world` (robot, objects, arena, camera with its depth image, chosen grasp), `maps` (quality,
    angle, width), `grid` (entropy, utility and the controller's other grids, seen from above, world x to the
    right), `twist`, `arm`, `controller` (its scalars) and `events`, all over the timeline `sim_time`.

    Raises:
        OutputError: the file cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = claim_file(path, (".rrd",))
        self._stream = rr.RecordingStream("mpgrasp", recording_id=None)
        # not rerun's own file: on a full disk it waits for hours, and leaves half a recording behind
        self._bytes = rr.binary_stream(self._stream)
        self._stream.send_blueprint(make_blueprint(), make_active=False)
        self._begin()

    def _begin(self) -> None:
        self._scene: RerunModel | None = None
        self._phase: str | None = None
        self._event: str | None = None

    def start(self, simulation: Simulation) -> None:
        log = self._stream.log
        log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for motion in ("linear", "angular"):
            for kind in ("commanded", "achieved"):
                names = [f"{kind} {axis}" for axis in _AXES]
                log(f"twist/{motion}/{kind}", rr.SeriesLines(names=names), static=True)
        self._scene = RerunModel(self._stream, simulation.model, "world/scene")
        self._stream.set_time(TIMELINE, duration=simulation.time)
        self._scene.log_poses(simulation.data)

    def tick(self, record: TickRecord) -> None:
        log, simulation = self._stream.log, record.simulation
        if record.frame is not None:  # what was seen, and thought of it, belongs to the exposure
            self._stream.set_time(TIMELINE, duration=record.frame.time)
            self._log_frame(record.frame)
        if record.grasp_map is not None:
            self._log_maps(record.grasp_map)
        for name, value in record.diagnostics.items():
            self._log_diagnostic(name, value)
        self._stream.set_time(TIMELINE, duration=simulation.time)
        if self._scene is not None:
            self._scene.log_poses(simulation.data)
        if record.phase != self._phase:
            log("events", rr.TextLog(f"phase: {record.phase}", level="INFO"))
            self._phase = record.phase
        if record.event is not None and record.event != self._event:
            log("events", rr.TextLog(record.event, level="WARN"))
        self._event = record.event
        for kind, twist in (("commanded", record.twist_commanded), ("achieved", record.twist_achieved)):
            log(f"twist/linear/{kind}", rr.Scalars(twist[:3]))
            log(f"twist/angular/{kind}", rr.Scalars(twist[3:]))
        log("arm/min_singular_value", rr.Scalars(record.min_singular_value))
        log("arm/manipulability", rr.Scalars(record.manipulability))
        log("arm/tcp_height", rr.Scalars(simulation.T_world_tcp[2, 3]))
        log("arm/gripper_width", rr.Scalars(simulation.gripper_width))
        if record.grasp is not None:
            strips = grasp_lines(record.grasp)
            log("world/grasp", rr.LineStrips3D(strips, colors=[_GRASP_COLOUR], radii=[0.0015]))

    def finish(self, event: str) -> None:
        """Write the file as a whole.

        Raises:
            OutputError: the disk does not take it, or rerun does not hand it over within `FLUSH_LIMIT`.
        """
        self._stream.log("events", rr.TextLog(event, level="INFO"))
        try:
            content = self._bytes.read(flush_timeout_sec=FLUSH_LIMIT)
        except (RuntimeError, ValueError) as error:
            raise OutputError(f"a recording cannot be finished: {error}", got=str(self.path)) from error
        self._stream.disconnect()
        try:
            replace_file(self.path, content or b"")
        except OSError as error:
            raise OutputError(
                f"a recording cannot be written: {error.strerror or error}", got=str(self.path)
            ) from error

    def _log_frame(self, frame: DepthFrame) -> None:
        shape = frame.depth.shape
        if max(shape) > _IMAGE_SIZE:
            frame = crop_resize(frame, min(shape), _IMAGE_SIZE)
        i, T = frame.intrinsics, frame.T_world_camera
        units = np.nan_to_num(frame.depth * _DEPTH_UNITS).clip(0, 65535).astype(np.uint16)
        self._stream.log(
            "world/camera",
            rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3]),
            rr.Pinhole(
                focal_length=[i.fx, i.fy],
                principal_point=[i.cx + 0.5, i.cy + 0.5],  # rerun counts from the corner of the first pixel
                width=i.width,
                height=i.height,
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.1,
            ),
        )
        image = rr.EncodedDepthImage(_encoded(".png", units), media_type="image/png", meter=_DEPTH_UNITS)
        self._stream.log("world/camera/depth", image)

    def _log_maps(self, grasp_map: GraspMap) -> None:
        pictures = {
            "quality": shade(grasp_map.quality, 0.0, 1.0),
            "angle": shade_lines(grasp_map.angle, grasp_map.quality),
            "width": shade(grasp_map.world_width(), 0.0, _WIDEST),
        }
        for name, picture in pictures.items():
            self._log_picture(f"maps/{name}", picture)

    def _log_diagnostic(self, name: str, value: FloatArray | float | bool) -> None:
        if np.ndim(value) == 2:
            # rows are world y: turned over, so that the picture is a view from above
            self._log_picture(f"grid/{name}", shade(np.asarray(value, float)[::-1]))
        elif np.ndim(value) == 0:
            self._stream.log(f"controller/{name}", rr.Scalars(float(value)))

    def _log_picture(self, path: str, picture: np.ndarray) -> None:
        blob = _encoded(".jpg", picture[..., ::-1], _JPEG)
        self._stream.log(path, rr.EncodedImage(contents=blob, media_type="image/jpeg"))


def grasp_lines(grasp: Grasp) -> list[FloatArray]:
    """A grasp drawn as a fork: polylines (n, 3) [m] in the world."""
    half, back = grasp.width / 2, -_FINGER_LENGTH
    fork = np.array([[0, -half, 0], [0, -half, back], [0, half, back], [0, half, 0]])
    stem = np.array([[0, 0, back], [0, 0, 2 * back]])
    T = grasp.T_world_grasp()
    return [transform_points(T, fork), transform_points(T, stem)]


def _encoded(suffix: str, image: np.ndarray, settings: list[int] | None = None) -> bytes:
    done, blob = cv2.imencode(suffix, image, settings or [])
    if not done:
        raise OutputError(f"an image cannot be encoded as {suffix}", got=image.shape)
    return blob.tobytes()


def make_blueprint() -> rrb.Blueprint:
    """Return the layout of the viewer."""

    def image(origin: str, name: str) -> Any:
        return rrb.Spatial2DView(origin=origin, name=name)

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(
                    origin="world",
                    name="World",
                    eye_controls=rrb.EyeControls3D(position=(1.5, -0.9, 0.9), look_target=(0.4, 0.0, 0.2)),
                ),
                rrb.TextLogView(origin="events", name="Events"),
                row_shares=[4, 1],
            ),
            rrb.Vertical(
                rrb.Horizontal(image("world/camera/depth", "Depth"), image("maps/quality", "Quality Q")),
                rrb.Horizontal(image("maps/angle", "Angle"), image("maps/width", "Width")),
                rrb.Horizontal(image("grid/entropy", "Entropy"), image("grid/utility", "Utility")),
            ),
            rrb.Vertical(
                rrb.TimeSeriesView(origin="twist/linear", name="Linear velocity [m/s]"),
                rrb.TimeSeriesView(origin="twist/angular", name="Angular velocity [rad/s]"),
                rrb.TimeSeriesView(origin="arm", name="Arm"),
            ),
            column_shares=[5, 4, 3],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )

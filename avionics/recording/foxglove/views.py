"""What Foxglove draws without set-up, derived from the records: the wing, the overlay, the camera.

Never read back: these messages follow from the records before them, by arithmetic alone.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from avionics.config import ByCamera, Camera, Config, FlightConfig, stations
from avionics.kinds import PAPER
from avionics.recording.foxglove.colours import COLOURS
from avionics.recording.foxglove.overlay import Overlay
from avionics.recording.schema.messages import NANOSECONDS, camera_frame, to_timestamp
from avionics.records import FloatArray, MarkerTracks, Truth, WingShapeEstimate
from avionics.topics import Record
from avionics.wse.pinhole import opencv_pose

SCENE_PERIOD_NS = 100_000_000
Views = list[tuple[str, Message]]
NO_LINE = np.empty((0, 3))


class FoxgloveViews:
    """Makes the views of one log.

    Parameters
    ----------
    config : Config or WingsConfig
        Wings, markers and cameras.
    utc_offset_ns : int
        UTC minus steady time, ns.
    """

    def __init__(self, config: FlightConfig, *, utc_offset_ns: int) -> None:
        self._cameras = config.cameras
        self._utc_offset_ns = utc_offset_ns
        self._has_begun = False
        configs = config.wing_configs
        wings = [_WingViews(each, utc_offset_ns=utc_offset_ns) for each in configs]
        self._first = wings[0]
        self._by_wing = {each.wing.name: wing for each, wing in zip(configs, wings, strict=True)}
        self._by_camera = ByCamera(config, wings)

    def of(self, record: Record, arrival_ns: int) -> Views:
        """Return topic and message of every view that this record calls for.

        A message holds until the next call.
        """
        if not self._has_begun:
            self._has_begun = True
            return [*self._still_life(arrival_ns), *self._moving(record)]
        return self._moving(record)

    def _moving(self, record: Record) -> Views:
        if isinstance(record, WingShapeEstimate | Truth):
            return self._by_wing.get(record.wing, self._first).of(record)
        if isinstance(record, MarkerTracks):
            wing = self._by_camera.get(record.camera)
            return [] if wing is None else wing.of(record)
        return []

    def _still_life(self, arrival_ns: int) -> Views:
        """Draw what does not move: z-down body axes under a z-up world, and the cameras."""
        stamp = to_timestamp(arrival_ns + self._utc_offset_ns)
        half_turn = Quaternion(x=1.0)
        body = FrameTransform(
            timestamp=stamp, parent_frame_id="world", child_frame_id="body", rotation=half_turn
        )
        views: Views = [("/tf", body)]
        for camera in self._cameras:
            views += [
                (f"/camera/{camera.name}/calibration", _calibration(camera, stamp)),
                ("/tf", _camera_pose(camera, stamp)),
            ]
        return views


class _WingViews:
    """Draws one wing, in space and in the pictures of its camera."""

    def __init__(self, config: Config, *, utc_offset_ns: int) -> None:
        self._utc_offset_ns = utc_offset_ns
        self._drawn_ns: dict[str, int] = {}
        self._scenes: dict[str, _Scene] = {}
        self._overlay = Overlay(utc_offset_ns=utc_offset_ns)
        placed = sorted({*stations(config.pods), *stations(config.markers)})
        self._stations = np.array([*placed, config.wing.span_m]) / config.wing.span_m

    def of(self, record: WingShapeEstimate | Truth | MarkerTracks) -> Views:
        """Return topic and message of the views of a record."""
        if isinstance(record, WingShapeEstimate):
            if record.kind in PAPER:
                self._overlay.note(record)
            if record.kind in COLOURS and self._is_due(record.kind, record.t_ns):
                line_m = record.line_in_body_m
                return self._wing(record, record.kind, line_m, self._dots(line_m))
        elif isinstance(record, MarkerTracks):
            return [(f"/camera/{record.camera}/annotations", self._overlay.of(record))]
        elif self._is_due("truth", record.t_ns):
            line_m = NO_LINE if record.line_in_body_m is None else record.line_in_body_m
            seen_m = record.marker_in_body_m
            return self._wing(record, "truth", line_m, seen_m[np.isfinite(seen_m).all(axis=1)])
        return []

    def _is_due(self, kind: str, t_ns: int) -> bool:
        """Return whether a wing was not drawn just now."""
        return not 0 <= t_ns - self._drawn_ns.get(kind, -1 << 62) < SCENE_PERIOD_NS

    def _dots(self, line_m: FloatArray) -> FloatArray:
        """Return the line's points at pods, markers and tip."""
        along = _fractions(len(line_m))
        return np.stack([np.interp(self._stations, along, axis) for axis in line_m.T], axis=1)

    def _wing(
        self, row: WingShapeEstimate | Truth, kind: str, line_m: FloatArray, dots_m: FloatArray
    ) -> Views:
        self._drawn_ns[kind] = row.t_ns
        scene = self._scenes.get(kind)
        if scene is None or (len(scene.points), len(scene.dots)) != (len(line_m), len(dots_m)):
            scene = self._scenes[kind] = _blank_scene(kind, len(line_m), len(dots_m))
        seconds, nanos = divmod(row.t_ns + self._utc_offset_ns, NANOSECONDS)
        scene.stamp.seconds, scene.stamp.nanos = seconds, nanos
        for at, (x, y, z) in zip(scene.points, line_m.tolist(), strict=True):
            at.x, at.y, at.z = x, y, z
        for place, (x, y, z) in zip(scene.dots, dots_m.tolist(), strict=True):
            place.x, place.y, place.z = x, y, z
        return [(f"/wing/{row.wing}/scene", scene.message)]


@lru_cache(maxsize=4)
def _fractions(count: int) -> FloatArray:
    return np.linspace(0.0, 1.0, count)


class _Scene(NamedTuple):
    """A message with its parts at hand; moving them takes a tenth of making a new one.

    Attributes
    ----------
    message : SceneUpdate
        A line with dots.
    stamp : Timestamp
        Its time.
    points : list of Point3
        Points of the line.
    dots : list of Vector3
        Centres of the dots.
    """

    message: SceneUpdate
    stamp: Timestamp
    points: list[Point3]
    dots: list[Vector3]


def _blank_scene(kind: str, points: int, dots: int) -> _Scene:
    colour = COLOURS[kind]
    line = LinePrimitive(
        type=LinePrimitive.LINE_STRIP,
        thickness=4.0,
        scale_invariant=True,
        points=[Point3() for _ in range(points)],
        color=colour,
    )
    sphere = SpherePrimitive(
        pose=Pose(position=Vector3(), orientation=Quaternion(w=1.0)),
        size=Vector3(x=0.02, y=0.02, z=0.02),
        color=colour,
    )
    entity = SceneEntity(
        timestamp=Timestamp(), frame_id="body", id=kind, lines=[line], spheres=[sphere] * dots
    )
    message = SceneUpdate(entities=[entity])
    (drawn,) = message.entities
    return _Scene(
        message,
        drawn.timestamp,
        list(drawn.lines[0].points),
        [ball.pose.position for ball in drawn.spheres],
    )


def _camera_pose(camera: Camera, stamp: Timestamp) -> FrameTransform:
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 (slow; readers draw nothing)

    from avionics.flight.filter_setup import pinhole_from_config  # noqa: PLC0415

    pinhole = pinhole_from_config(camera)
    rotation, _ = opencv_pose(pinhole)
    x, y, z, w = Rotation.from_matrix(rotation.T).as_quat().tolist()
    at = pinhole.r_cam_in_body.tolist()
    return FrameTransform(
        timestamp=stamp,
        parent_frame_id="body",
        child_frame_id=camera_frame(camera.name),
        translation=Vector3(x=at[0], y=at[1], z=at[2]),
        rotation=Quaternion(x=x, y=y, z=z, w=w),
    )


def _calibration(camera: Camera, stamp: Timestamp) -> CameraCalibration:
    f_x, f_y, c_x, c_y = camera.f_x_px, camera.f_y_px, camera.c_x_px, camera.c_y_px
    return CameraCalibration(
        timestamp=stamp,
        frame_id=camera_frame(camera.name),
        width=camera.width_px,
        height=camera.height_px,
        distortion_model="plumb_bob",
        D=[camera.k1, camera.k2, camera.p1, camera.p2, camera.k3],
        K=[f_x, 0.0, c_x, 0.0, f_y, c_y, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[f_x, 0.0, c_x, 0.0, 0.0, f_y, c_y, 0.0, 0.0, 0.0, 1.0, 0.0],
    )

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CircleAnnotation_pb2 import CircleAnnotation
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from mcap.reader import make_reader
from scipy.spatial.transform import Rotation

from avionics.config import Config
from avionics.config.load import parse_config
from avionics.recording import LogReader, LogWriter
from avionics.recording.foxglove.views import FoxgloveViews
from avionics.recording.schema.messages import from_timestamp, to_timestamp
from avionics.records import MarkerTracks, Truth, WingShapeEstimate

UTC_OFFSET_NS = 10**18


def estimate(t_ns: int, kind: str, u_px: float, wing: str = "right") -> WingShapeEstimate:
    line = np.column_stack([np.zeros(4), np.linspace(0, 1.5, 4), np.full(4, t_ns * 1e-9)])
    one, pods = np.zeros(1), np.zeros((0, 3))
    pixel = np.array([[u_px, 200.0], [np.nan, np.nan]])
    return WingShapeEstimate(
        t_ns, wing, kind, "b", one, one, one, one, one, one, pods, pods, line, np.zeros(3),
        pixel, pixel, 0.0, np.ones(2, bool),
    )  # fmt: skip


@pytest.fixture
def log(log_path: Path, config: Config) -> Path:
    found = np.array([True, False])
    tracks = MarkerTracks(
        74_000_000, "root", 2, np.array([[120.25, 201.0], [np.nan, np.nan]]), np.ones(2), found
    )
    with LogWriter(log_path, config, utc_offset_ns=UTC_OFFSET_NS) as writer:
        for number in range(11):
            t_ns = number * 10_000_000
            for record in (
                estimate(t_ns, "rg", 300.0),
                estimate(t_ns, "crg", 100.0 + number),
                Truth(t_ns, "right", "sim", np.zeros((0, 3)), np.zeros((4, 3))),
            ):
                writer.write(record, t_ns)
        writer.write(tracks, 110_000_000)
    return log_path


def views(path: Path, topic: str) -> list[bytes]:
    with path.open("rb") as file:
        return [message.data for _, _, message in make_reader(file).iter_messages(topic)]


def test_scene_shows_each_estimate_and_the_truth_at_most_ten_times_a_second(log: Path) -> None:
    entities = [
        SceneUpdate.FromString(data).entities[0] for data in views(log, "/wing/right/scene")
    ]
    for kind in ("rg", "crg", "truth"):
        times = [from_timestamp(e.timestamp) - UTC_OFFSET_NS for e in entities if e.id == kind]
        assert times == [0, 100_000_000]
    last = [entity for entity in entities if entity.id == "crg"][-1]
    points = [(p.x, p.y, p.z) for p in last.lines[0].points]
    assert points[-1] == (0.0, 1.5, 0.1)
    tip = last.spheres[-1].pose.position
    assert (tip.x, tip.y, tip.z) == pytest.approx((0.0, 1.5, 0.1))
    assert entities[0].lines[0].color != entities[1].lines[0].color


def test_motion_capture_shows_its_markers(log_path: Path, config: Config) -> None:
    markers = np.array([[0.1, 0.2, 0.3], [np.nan, np.nan, np.nan], [0.4, 0.5, 0.6]])
    with LogWriter(log_path, config) as writer:
        truth = Truth(0, "right", "mocap", markers)
        writer.write(truth, 0)
    (data,) = views(log_path, "/wing/right/scene")
    spheres = SceneUpdate.FromString(data).entities[0].spheres
    places = [(s.pose.position.x, s.pose.position.y, s.pose.position.z) for s in spheres]
    assert places == [(0.1, 0.2, 0.3), (0.4, 0.5, 0.6)]


def test_overlay_has_tracks_and_predictions_at_the_exposure(log: Path) -> None:
    (data,) = views(log, "/camera/root/annotations")
    overlay = ImageAnnotations.FromString(data)
    (square,) = overlay.points
    centre = np.mean([(p.x, p.y) for p in square.points], axis=0)
    np.testing.assert_allclose(centre, [120.75, 201.5])  # Foxglove counts from the pixel's corner
    assert from_timestamp(square.timestamp) == 74_000_000 + UTC_OFFSET_NS
    rg, crg = overlay.circles
    assert (rg.position.x, rg.position.y) == (300.5, 200.5)
    assert crg.position.x == pytest.approx(107.4 + 0.5)  # between the rows at 70 and 80 ms


def test_calibration_is_that_of_the_configuration(log: Path, config: Config) -> None:
    (data,) = views(log, "/camera/root/calibration")
    calibration = CameraCalibration.FromString(data)
    assert config.camera is not None
    assert (calibration.width, calibration.height) == (640, 480)
    assert calibration.K[0] == config.camera.f_x_px
    assert list(calibration.D)[:2] == [config.camera.k1, config.camera.k2]


def test_camera_stands_where_the_configuration_says(log: Path, config: Config) -> None:
    poses = [FrameTransform.FromString(data) for data in views(log, "/tf")]
    (pose,) = (p for p in poses if p.parent_frame_id == "body")
    assert config.camera is not None
    at = (pose.translation.x, pose.translation.y, pose.translation.z)
    assert at == config.camera.r_in_body_m
    q = pose.rotation
    axis = Rotation.from_quat([q.x, q.y, q.z, q.w]).apply([0.0, 0.0, 1.0])
    tilt = np.radians(config.camera.tilt_deg)  # negative looks down, z is down
    np.testing.assert_allclose(axis, [0.0, np.cos(tilt), -np.sin(tilt)], atol=1e-12)


def test_views_are_no_records(log: Path) -> None:
    assert {item.topic for item in LogReader(log).messages()} == {
        "/wing/right/estimate_rg",
        "/wing/right/estimate_crg",
        "/wing/right/truth",
        "/camera/root/tracks",
    }


COLOURS = {
    "rg": (0.85, 0.85, 0.85),
    "crg": (0.95, 0.25, 0.2),
    "gs": (0.95, 0.65, 0.1),
    "truth": (0.2, 0.75, 0.3),
    "tracks": (0.25, 0.75, 1.0),
}


def colour(name: str) -> Color:
    red, green, blue = COLOURS[name]
    return Color(r=red, g=green, b=blue, a=1.0)


def plain_overlay(
    tracks: MarkerTracks, circles: list[tuple[str, float, float]]
) -> ImageAnnotations:
    """Make the annotations again, in the plainest way."""
    stamp = to_timestamp(tracks.t_ns + UTC_OFFSET_NS)
    overlay = ImageAnnotations()
    for (u, v), is_found in zip(tracks.pixel, tracks.found, strict=True):
        if is_found:
            overlay.points.append(
                PointsAnnotation(
                    timestamp=stamp,
                    type=PointsAnnotation.LINE_LOOP,
                    points=[
                        Point2(x=u + a + 0.5, y=v + b + 0.5)
                        for a, b in [(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)]
                    ],
                    outline_color=colour("tracks"),
                    thickness=1.0,
                )
            )
    for kind, u, v in circles:
        overlay.circles.append(
            CircleAnnotation(
                timestamp=stamp,
                position=Point2(x=u, y=v),
                diameter=8.0,
                thickness=1.0,
                outline_color=colour(kind),
            )
        )
    return overlay


def test_overlay_is_the_same_as_one_made_anew(config: Config) -> None:
    """Found and lost markers come and go; nothing of an earlier frame stays."""
    rng = np.random.default_rng(5)
    views_of = FoxgloveViews(config, utc_offset_ns=UTC_OFFSET_NS)
    for number in range(60):
        t_ns = number * 10_000_000
        circles = []
        for kind in ("rg", "crg"):
            pixel = rng.normal(size=(5, 2)) * 200
            pixel[rng.random(5) < 0.2] = np.nan
            pixel[rng.random(5) < 0.2] = -0.5
            circles += [(kind, u + 0.5, v + 0.5) for u, v in pixel if np.isfinite(u)]
            row = replace(estimate(t_ns, kind, 0.0), marker_px=pixel)
            views_of.of(row, t_ns)
        found = rng.random(5) < 0.7
        pixel = np.where(found[:, None], rng.integers(0, 3, (5, 2)) * 2.25 - 5.5, np.nan)
        tracks = MarkerTracks(t_ns, "root", number, pixel, np.ones(5), found)
        ((topic, message),) = views_of.of(tracks, t_ns)
        assert topic == "/camera/root/annotations"
        expected = plain_overlay(tracks, circles)
        assert serialised(message) == serialised(expected)


def serialised(message: Message) -> bytes:
    return message.SerializeToString(deterministic=True)


def test_scene_is_the_same_as_one_made_anew(config: Config) -> None:
    """Markers of the truth come and go; nothing of an earlier scene stays."""
    rng = np.random.default_rng(6)
    views_of = FoxgloveViews(config, utc_offset_ns=UTC_OFFSET_NS)
    views_of.of(Truth(-(10**9), "right", "sim", np.zeros((0, 3))), 0)
    for number in range(30):
        t_ns = number * 100_000_000
        line = rng.integers(-1, 2, (int(rng.integers(3, 5)), 3)) * 0.7
        dots = np.where(rng.random((6, 1)) < 0.3, np.nan, rng.integers(-1, 2, (6, 3)) * 0.3)
        truth = Truth(t_ns, "right", "mocap", dots, line)
        ((topic, message),) = views_of.of(truth, t_ns)
        assert topic == "/wing/right/scene"
        entity = SceneEntity(
            timestamp=to_timestamp(t_ns + UTC_OFFSET_NS), frame_id="body", id="truth"
        )
        entity.lines.append(
            LinePrimitive(
                type=LinePrimitive.LINE_STRIP,
                thickness=4.0,
                scale_invariant=True,
                points=[Point3(x=x, y=y, z=z) for x, y, z in line],
                color=colour("truth"),
            )
        )
        for x, y, z in dots[np.isfinite(dots).all(axis=1)]:
            pose = Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(w=1.0))
            size = Vector3(x=0.02, y=0.02, z=0.02)
            entity.spheres.append(SpherePrimitive(pose=pose, size=size, color=colour("truth")))
        assert serialised(message) == serialised(SceneUpdate(entities=[entity]))


def test_wings_are_drawn_apart_and_every_camera_shows_its_own(
    log_path: Path, config: Config
) -> None:
    shared = config.model_dump(exclude={"wing", "pods", "markers", "truth_markers", "camera"})
    wings = [
        {
            **config.wing.model_dump(),
            "name": name,
            "side": name,
            "camera": config.camera.model_copy(update={"name": f"eye {name}"}).model_dump(),
        }
        for name in ("left", "right")
    ]
    two = parse_config({"wings": wings, **shared}, origin="test")
    pixel, found = np.full((2, 2), 50.0), np.array([True, False])
    with LogWriter(log_path, two) as writer:
        for wing, u_px in (("left", 100.0), ("right", 300.0)):
            writer.write(estimate(0, "crg", u_px, wing), 0)
        writer.write(MarkerTracks(0, "eye left", 0, pixel, np.ones(2), found), 1)
        writer.write(MarkerTracks(0, "eye middle", 0, pixel, np.ones(2), found), 2)
    for wing in ("left", "right"):
        (scene,) = views(log_path, f"/wing/{wing}/scene")
        assert [entity.id for entity in SceneUpdate.FromString(scene).entities] == ["crg"]
    (drawn,) = views(log_path, "/camera/eye left/annotations")
    circles = ImageAnnotations.FromString(drawn).circles
    assert [circle.position.x for circle in circles] == [100.5]
    assert not views(log_path, "/camera/eye middle/annotations")
    frames = [FrameTransform.FromString(data).child_frame_id for data in views(log_path, "/tf")]
    assert len(frames) == len(set(frames)) == 3

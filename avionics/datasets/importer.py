"""A recorded data set becomes a log, its camera calibrated on the way if asked."""

import heapq
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from rich.markup import escape
from rich.table import Table

from avionics.config import Camera, Config, Estimator, Marker, Pod, Recorder, Wing
from avionics.config.chips import GYRO_BANDWIDTHS_HZ, Bno055Settings
from avionics.config.load import explain
from avionics.datasets.camera_calibration import SetCalibration, calibrate_set
from avionics.datasets.data_set import DataSet, read_data_set
from avionics.errors import DataSetError
from avionics.recording import LogWriter, appearing_whole
from avionics.records import Event, Truth
from avionics.topics import Record
from drivers.gyro_delay import low_pass_delay_s
from drivers.samples import Frame, ImuSample

CALIBRATION_JSON = "calibration.json"
IMPORTER = "import"
Progress = Callable[[float], None]


@dataclass(slots=True)
class ImportSummary:
    """What came in.

    Attributes
    ----------
    counts : dict of str to int
        Records by kind.
    notes : list of str
        What was left out, and what could not be calibrated.
    calibration : SetCalibration or None
    """

    counts: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    calibration: SetCalibration | None = None

    def text(self) -> Table:
        """Return the summary for a person."""
        table = Table(box=None, show_header=False, pad_edge=False)
        for what, count in self.counts.items():
            table.add_row(what, str(count))
        if self.calibration is not None:
            for row in _calibration_rows(self.calibration):
                table.add_row(*row)
        for note in self.notes:
            table.add_row("[yellow]note[/]", escape(note))
        return table


def _calibration_rows(found: SetCalibration) -> list[tuple[str, str]]:
    rows = []
    if found.lens is not None:
        rows.append(
            ("lens", f"{found.lens.boards} chessboards, residual {found.lens.rms_px:.3f} px")
        )
    if found.pose is not None:
        pose = found.pose
        rows.append(
            (
                "pose",
                f"{found.measurements} measurements in {found.instants} pictures, "
                f"residual {pose.rms_px:.2f} px per axis",
            )
        )
        rows += [
            (name, f"{value:.4f} +- {pose.sigma[name]:.4f}") for name, value in pose.values.items()
        ]
    return rows


def import_set(
    directory: Path,
    output: Path,
    *,
    calibrate: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> ImportSummary:
    """Write the log of a data set.

    Parameters
    ----------
    directory : Path
        The set: wing.yaml, imu.csv and what else it has.
    output : Path
        The log.
    calibrate : bool
        Find lens and pose of the camera from the set's chessboards and motion capture.
    force : bool
        Replace an existing log.
    progress : callable, optional
        Called with the seconds written.

    Raises
    ------
    DataSetError
        If the set cannot be used.
    RecordingError
        If the log cannot be written.
    """
    data = read_data_set(directory)
    config = config_of(data)
    summary = ImportSummary()
    attachments: dict[str, bytes] = {}
    if calibrate and config.camera is None:
        summary.notes.append("wing.yaml describes no camera; nothing was calibrated")
    elif calibrate:
        summary.calibration = calibrate_set(data, config)
        config = config.model_copy(update={"camera": summary.calibration.camera})
        found = summary.calibration.to_json_dict()
        attachments[CALIBRATION_JSON] = json.dumps(found, indent=1).encode()
        summary.notes += summary.calibration.notes
    metadata = {"command": "import", "source": directory.resolve().name}
    with (
        appearing_whole(output, force=force) as part,
        LogWriter(part, config, metadata=metadata, attachments=attachments, force=True) as writer,
    ):
        start_ns, last_ns = None, 0
        for arrival_ns, _, record in heapq.merge(
            _imu_events(data), _frame_events(data, config), _truth_events(data, config),
            key=lambda event: (event[0], event[1]),
        ):  # fmt: skip
            start_ns, last_ns = start_ns or arrival_ns, arrival_ns
            writer.write(record, arrival_ns)
            kind = type(record).__name__
            summary.counts[kind] = summary.counts.get(kind, 0) + 1
            if progress is not None:
                progress((arrival_ns - start_ns) * 1e-9)
        summary.notes += data.skips.texts()
        for note in summary.notes:
            event = Event(last_ns, IMPORTER, "warning", note)
            writer.write(event, last_ns)
    return summary


def config_of(data: DataSet) -> Config:
    """Return the configuration that a data set describes.

    Raises
    ------
    DataSetError
        If its values contradict each other.
    """
    wing, imu = data.wing, data.wing.imu
    bandwidth = min(GYRO_BANDWIDTHS_HZ, key=lambda hz: abs(hz - imu.gyro_bandwidth_hz))
    chip = Bno055Settings.model_validate(
        {"mode": "ndof", "gyro_bandwidth_hz": bandwidth, "rate_hz": imu.rate_hz}
    )
    # A set does not give a register's age. Fusion modes hold the bandwidth themselves.
    lag_s = low_pass_delay_s(imu.gyro_bandwidth_hz)
    is_known = abs(chip.delay.filter_s / lag_s - 1.0) * imu.gyro_bandwidth_hz < 0.5
    try:
        return Config(
            wing=Wing(
                name="left" if wing.wing.side == "left" else "right",
                side="left" if wing.wing.side == "left" else "right",
                span_m=wing.wing.span_m,
                psi0_deg=wing.wing.psi0_deg,
            ),
            pods=tuple(
                Pod(id=p.id, s_m=p.s_m, R_sensor_from_local=p.R_sensor_from_drl, chip=chip)
                for p in wing.pods
            ),
            markers=tuple(Marker(id=m.id, s_m=m.s, x_m=m.x, z_m=m.z) for m in wing.markers),
            truth_markers=()
            if wing.mocap is None
            else tuple(Marker(id=m.id, s_m=m.s, x_m=m.x, z_m=m.z) for m in wing.mocap.markers),
            camera=_camera(data),
            estimator=Estimator(
                gyro_noise_dps_sqrthz=imu.gyro_noise_dps_sqrthz,
                bias_sigma_dps=imu.zero_rate_offset_dps_max,
                gyro_lag_s="filter" if is_known else lag_s,
                rows_at_once=50,  # nobody waits for a recorded row
            ),
            recorder=Recorder(image_format="png"),
        )
    except ValidationError as error:
        origin = str(data.directory / "wing.yaml")
        raise DataSetError(explain(origin, error.errors()[0])) from error


def _camera(data: DataSet) -> Camera | None:
    part = data.wing.camera
    if part is None:
        return None
    f_x_px, f_y_px = part.nominal.focal_px
    nominal = part.nominal
    return Camera(
        width_px=part.width, height_px=part.height, fps=part.fps, exposure_s=part.exposure_s,
        f_x_px=f_x_px, f_y_px=f_y_px, c_x_px=nominal.cx, c_y_px=nominal.cy,
        k1=nominal.k1, k2=nominal.k2, p1=nominal.p1, p2=nominal.p2,
        tilt_deg=nominal.tilt_deg, pan_deg=nominal.pan_deg, roll_deg=nominal.roll_deg,
        r_in_body_m=nominal.r_body_m,
    )  # fmt: skip


Event3 = tuple[int, int, Record]


def _imu_events(data: DataSet) -> Iterator[Event3]:
    scale = data.wing.imu
    per_count = np.repeat(
        [
            math.radians(1.0 / scale.gyro_lsb_per_dps),
            1.0 / scale.accel_lsb_per_mps2,
            1e-6 / scale.mag_lsb_per_ut,
        ],
        3,
    )
    seq = dict.fromkeys(data.imu.pod.tolist(), 0)
    values = data.imu.counts * per_count
    rows = zip(data.imu.t_ns.tolist(), data.imu.pod.tolist(), values, strict=True)
    for t_ns, pod, value in rows:
        number = seq[pod]
        seq[pod] = number + 1
        force, flux = value[3:6], value[6:9]
        yield (
            t_ns,
            0,
            ImuSample(
                t_ns,
                str(pod),
                number,
                value[:3].copy(),
                force.copy() if np.isfinite(force).all() else None,
                flux.copy() if np.isfinite(flux).all() else None,
            ),
        )


def _frame_events(data: DataSet, config: Config) -> Iterator[Event3]:
    """Yield the frames by arrival; they leave the video by exposure."""
    if data.frames is None or config.camera is None:
        return
    frames, waiting = data.frames, list[tuple[int, int, Frame]]()
    # What has not been read yet arrives no sooner than the least arrival of the rows to come.
    least = np.minimum.accumulate(frames.t_arrival_ns[::-1])[::-1]
    for row, image in data.pictures():
        if image.shape != (config.camera.height_px, config.camera.width_px):
            found = f"{image.shape[1]} x {image.shape[0]}"
            msg = (
                f"{data.video}: pictures of {found} px, wing.yaml says "
                f"{config.camera.width_px} x {config.camera.height_px}"
            )
            raise DataSetError(msg)
        frame = Frame(
            int(frames.t_exposure_ns[row]), config.camera.name, int(frames.number[row]), image
        )
        heapq.heappush(waiting, (int(frames.t_arrival_ns[row]), row, frame))
        rest_ns = int(least[row + 1]) if row + 1 < len(least) else None
        while waiting and rest_ns is not None and waiting[0][0] <= rest_ns:
            arrival_ns, _, ready = heapq.heappop(waiting)
            yield arrival_ns, 1, ready
    while waiting:
        arrival_ns, _, ready = heapq.heappop(waiting)
        yield arrival_ns, 1, ready


def _truth_events(data: DataSet, config: Config) -> Iterator[Event3]:
    if data.mocap is None:
        return
    for t_ns, marker_m in zip(data.mocap.t_ns.tolist(), data.mocap.marker_m, strict=True):
        yield t_ns, 2, Truth(t_ns, config.wing.name, "mocap", marker_m)

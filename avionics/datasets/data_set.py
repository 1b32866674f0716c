"""The data-set format: a folder with wing.yaml, imu.csv, a video, frames.csv and mocap.csv.

Everything is checked on the way in. What cannot be used is left out, counted and reported; what the
set cannot do without is an error that names file, row and remedy.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from avionics.datasets.csv_table import CsvColumns, Skips, read_csv
from avionics.datasets.wing_yaml import WingDescription, read_wing_yaml
from avionics.errors import DataSetError
from avionics.records import FloatArray
from drivers.cameras.file import open_video

TimeArray = NDArray[np.int64]
VIDEO_SUFFIXES = (".mkv", ".mp4", ".avi", ".mov")
MOST_AHEAD_NS = 1_000_000_000
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")


@dataclass(frozen=True, slots=True, eq=False)
class ImuTable:
    """All rows of imu.csv, in order of time.

    Attributes
    ----------
    t_ns : ndarray, shape (n,)
    pod : ndarray, shape (n,)
        Pod ids.
    counts : ndarray, shape (n, 9)
        gx gy gz ax ay az mx my mz as registers; NaN in columns that the set lacks.
    """

    t_ns: TimeArray
    pod: TimeArray
    counts: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class FrameTable:
    """Rows of frames.csv that have a picture; row k belongs to picture ``number[k]``.

    Attributes
    ----------
    number : ndarray, shape (n,)
        Position in the video.
    t_exposure_ns, t_arrival_ns : ndarray, shape (n,)
    """

    number: TimeArray
    t_exposure_ns: TimeArray
    t_arrival_ns: TimeArray


@dataclass(frozen=True, slots=True, eq=False)
class MocapTable:
    """Motion capture in body axes.

    Attributes
    ----------
    t_ns : ndarray, shape (n,)
    marker_m : ndarray, shape (n, K, 3)
        In the order of the description's mocap markers; NaN where missing.
    """

    t_ns: TimeArray
    marker_m: FloatArray


@dataclass(slots=True, eq=False)
class DataSet:
    """One set, read and checked.

    Attributes
    ----------
    directory : Path
    wing : WingDescription
        The content of wing.yaml.
    imu : ImuTable
    frames : FrameTable or None
    video : Path or None
    mocap : MocapTable or None
    chessboards : list of Path
    skips : Skips
        What was left out and why.
    """

    directory: Path
    wing: WingDescription
    imu: ImuTable
    frames: FrameTable | None
    video: Path | None
    mocap: MocapTable | None
    chessboards: list[Path] = field(default_factory=list)
    skips: Skips = field(default_factory=Skips)

    def pictures(self) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Yield the pictures of the video that frames.csv knows: row of ``frames``, gray image."""
        if self.video is None or self.frames is None:
            return
        wanted = {int(n): row for row, n in enumerate(self.frames.number)}
        shown = set()
        unknown = 0
        for number, image in enumerate(video_pictures(self.video)):
            row = wanted.get(number)
            if row is None:
                unknown += 1
                continue
            shown.add(number)
            yield row, image
        # A set may be walked through more than once; what is missing is reported once.
        known = {
            (self.video.name, "pictures without a row in frames.csv"): unknown,
            ("frames.csv", f"rows beyond the end of {self.video.name}"): len(wanted) - len(shown),
        }
        self.skips.counts.update({why: count for why, count in known.items() if count})


def video_pictures(path: Path) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures of a video, gray, shape (H, W).

    Raises
    ------
    DataSetError
        If the file is no video that this OpenCV reads.
    """
    capture = open_video(path)
    if capture is None:
        msg = f"{path}: is no video that OpenCV can read; is it whole?"
        raise DataSetError(msg)
    try:
        while True:
            is_there, image = capture.read()
            if not is_there:
                return
            if image.ndim == 3:
                # A gray video comes with three equal channels.
                first = image[:, :, 0]
                is_gray = bool((image[::8, ::8, 1] == first[::8, ::8]).all())
                image = first if is_gray else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
            yield np.ascontiguousarray(image)
    finally:
        capture.release()


def read_data_set(directory: Path) -> DataSet:
    """Read a data set.

    Raises
    ------
    DataSetError
        If the folder, wing.yaml or imu.csv is missing or unusable.
    """
    if not directory.is_dir():
        msg = f"{directory}: is not a folder; give the folder that holds wing.yaml and imu.csv"
        raise DataSetError(msg)
    skips = Skips()
    wing = read_wing_yaml(directory / "wing.yaml")
    imu = _read_imu(directory / "imu.csv", wing, skips)
    video = _find_video(directory, skips)
    frames = _read_frames(directory / "frames.csv", video, skips)
    mocap = _read_mocap(directory / "mocap.csv", wing, skips)
    boards = sorted(
        p for p in (directory / "chessboard").glob("*") if p.suffix.lower() in IMAGE_SUFFIXES
    )
    has_pictures = frames is not None and video is not None
    return DataSet(
        directory, wing, imu, frames if has_pictures else None,
        video if has_pictures else None, mocap, boards, skips,
    )  # fmt: skip


def _find_video(directory: Path, skips: Skips) -> Path | None:
    videos = sorted(p for p in directory.iterdir() if p.suffix.lower() in VIDEO_SUFFIXES)
    named = [p for p in videos if p.stem == "camera"] or videos
    if not named:
        skips.add(str(directory.name), "no video (camera.mkv): gyros alone")
        return None
    return named[0]


def _read_imu(path: Path, wing: WingDescription, skips: Skips) -> ImuTable:
    columns = ("gx", "gy", "gz", "ax", "ay", "az", "mx", "my", "mz")
    table = read_csv(path, CsvColumns(("t_ns", "pod"), columns[:3], columns[3:]), skips)
    t_ns, pod = table.integers[:, 0], table.integers[:, 1]
    known = np.isin(pod, [p.id for p in wing.pods])
    if not known.all():
        ids = ", ".join(str(i) for i in np.unique(pod[~known]))
        skips.add("imu.csv", f"rows of pods that wing.yaml does not name ({ids})", (~known).sum())
    full = np.abs(np.nan_to_num(table.numbers)) <= 1 << 15
    fits = known & full.all(axis=1)
    if (known & ~fits).any():
        skips.add("imu.csv", "rows beyond the range of a register", (known & ~fits).sum())
    order = np.argsort(t_ns[fits], kind="stable")
    t_ns, pod, counts = t_ns[fits][order], pod[fits][order], table.numbers[fits][order]
    keep = np.ones(len(t_ns), dtype=np.bool_)
    for number in np.unique(pod):
        rows = np.flatnonzero(pod == number)
        keep[rows[1:][np.diff(t_ns[rows]) == 0]] = False
    if not keep.all():
        skips.add("imu.csv", "rows that repeat a time of their pod", (~keep).sum())
    if not keep.any():
        msg = f"{path}: holds no usable row; expected t_ns,pod,gx,gy,gz,... below the header"
        raise DataSetError(msg)
    return ImuTable(t_ns[keep], pod[keep], counts[keep])


def _read_frames(path: Path, video: Path | None, skips: Skips) -> FrameTable | None:
    if not path.exists():
        if video is not None:
            skips.add(video.name, "no frames.csv: the video has no times and is not used")
        return None
    table = read_csv(path, CsvColumns(("frame", "t_exposure_ns"), (), ("t_arrival_ns",)), skips)
    number, exposure = table.integers[:, 0], table.integers[:, 1]
    arrival_text = table.numbers[:, 0] if table.numbers.shape[1] else np.empty(0)
    arrival = exposure.copy()
    if table.optional_integers is not None:
        arrival = np.where(np.isfinite(arrival_text), table.optional_integers[:, 0], exposure)
    order = np.argsort(number, kind="stable")
    number, exposure, arrival = number[order], exposure[order], arrival[order]
    good = np.concatenate([[True], np.diff(number) > 0])
    if not good.all():
        skips.add("frames.csv", "rows that repeat a frame number", (~good).sum())
    # A camera whose clock is ahead of the gyros' seems to deliver before it exposes: no matter.
    early = good & (arrival < exposure - MOST_AHEAD_NS)
    if early.any():
        skips.add("frames.csv", "frames that arrive a second before their exposure", early.sum())
    good &= ~early
    number, exposure, arrival = number[good], exposure[good], arrival[good]
    latest = np.maximum.accumulate(np.concatenate([[np.iinfo(np.int64).min], exposure]))[:-1]
    late = exposure <= latest
    if late.any():
        skips.add("frames.csv", "exposures that run backwards", late.sum())
    return FrameTable(number[~late], exposure[~late], arrival[~late])


def _read_mocap(path: Path, wing: WingDescription, skips: Skips) -> MocapTable | None:
    if not path.exists():
        return None
    if wing.mocap is None:
        skips.add("mocap.csv", "wing.yaml has no mocap section: motion capture is not used")
        return None
    names = [f"m{m.id}_{axis}" for m in wing.mocap.markers for axis in "xyz"]
    table = read_csv(path, CsvColumns(("t_ns",), (), tuple(names)), skips)
    absent = Counter(name.split("_")[0] for name in table.absent)
    for marker in absent:
        skips.add("mocap.csv", f"no column of marker {marker[1:]}")
    lab_m = table.numbers.reshape(len(table.numbers), -1, 3)
    t_ns = table.integers[:, 0]
    order = np.argsort(t_ns, kind="stable")
    t_ns, lab_m = t_ns[order], lab_m[order]
    good = np.concatenate([[True], np.diff(t_ns) > 0]) if len(t_ns) else np.zeros(0, bool)
    if not good.all():
        skips.add("mocap.csv", "rows that repeat a time", (~good).sum())
    if not good.any():
        skips.add("mocap.csv", "no usable row: motion capture is not used")
        return None
    # m_lab = R m_body + t, so components in body axes are R^T (m_lab - t).
    body_m = (lab_m[good] - wing.mocap.t_lab_m) @ wing.mocap.D_lab_from_body
    return MocapTable(t_ns[good], body_m)

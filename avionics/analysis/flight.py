"""A flight's log as arrays: the one place where a log becomes arrays.

``read_flight`` opens a log. The first array asked for makes one pass over the file, which decodes
every message once; pictures stay in the file until someone looks at them.
"""

from collections.abc import Collection, Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from avionics.analysis.collectors import HealthCollector
from avionics.analysis.contents import Contents, TopicArrays, TopicCount, read_contents
from avionics.analysis.frames import CameraData, Frames
from avionics.analysis.series import (
    EstimateSeries,
    HealthSeries,
    ImuSeries,
    TimeArray,
    TrackSeries,
    TruthSeries,
    WingData,
    seconds,
)
from avionics.analysis.tables import Table, tables_of
from avionics.config import FlightConfig
from avionics.config.wings import config_of_wing
from avionics.errors import RecordingError
from avionics.recording import Damage, LogReader
from avionics.records import Event, FloatArray
from avionics.topics import EVENT, HEALTH

T = TypeVar("T")


class Flight:
    """One log as arrays; see ``read_flight``.

    Attributes
    ----------
    path : Path
        The log.
    metadata : dict of str to str
        The metadata of the log: versions, command, seed, ...
    attachments : dict of str to bytes
        Attached files by name.
    utc_offset_ns : int
        UTC minus the steady clock of all times here, ns; 0 for simulated and imported flights.
    """

    def __init__(self, path: Path, topics: Collection[str] | None = None) -> None:
        self._reader = LogReader(path)
        self._topics = topics
        self.path = path
        self.metadata = self._reader.metadata
        self.attachments = self._reader.attachments
        self.utc_offset_ns = self._reader.utc_offset_ns

    def __repr__(self) -> str:
        """Return the name of the file and what is in it."""
        topics = ", ".join(f"{topic} ({one.count})" for topic, one in self.topics.items())
        return f"<Flight {self.path.name}: {topics or 'no records'}>"

    @property
    def config(self) -> FlightConfig:
        """The resolved configuration that flew.

        Raises
        ------
        RecordingError
            If the log holds none, or a damaged one.
        ConfigError
            If this version cannot read it.
        """
        return self._reader.config

    @cached_property
    def _contents(self) -> Contents:
        return read_contents(self._reader, self._topics)

    @property
    def damage(self) -> Damage:
        """What could not be read; equal to ``Damage()`` if the log is complete and undamaged."""
        return self._contents.damage

    @property
    def topics(self) -> dict[str, TopicCount]:
        """Topics of the log in order of appearance, with the number of their records."""
        return self._contents.topics

    @property
    def start_ns(self) -> int:
        """Zero of ``t_s``: the earliest gyro sample or estimate, ns of the steady clock."""
        return self._contents.start_ns

    @property
    def duration_s(self) -> float:
        """From the first arrival to the last, s."""
        counts = self.topics.values()
        if not counts:
            return 0.0
        return (max(c.last_ns for c in counts) - min(c.first_ns for c in counts)) * 1e-9

    def seconds(self, t_ns: TimeArray | int) -> FloatArray:
        """Return instants, ns of the steady clock, as seconds since ``start_ns``."""
        return seconds(np.asarray(t_ns, dtype=np.int64), self.start_ns)

    def utc(self, t_ns: TimeArray | int) -> NDArray[np.datetime64]:
        """Return instants, ns of the steady clock, as UTC of type ``datetime64[ns]``."""
        return (np.asarray(t_ns, dtype=np.int64) + self.utc_offset_ns).astype("datetime64[ns]")

    @property
    def by_topic(self) -> dict[str, TopicArrays]:
        """The arrays of every topic, in order of appearance."""
        return self._contents.series

    @cached_property
    def imu(self) -> dict[str, ImuSeries]:
        """Samples by pod, the root IMU as "root", in order of appearance."""
        return {one.pod: one for one in self._series_of(ImuSeries)}

    @cached_property
    def wings(self) -> dict[str, WingData]:
        """Estimates and truth by name of the wing, in order of appearance.

        If the log holds neither, the wings of the configuration, empty.
        """
        wings: dict[str, WingData] = {}
        for estimate in self._series_of(EstimateSeries):
            wing = wings.setdefault(estimate.wing, WingData(estimate.wing))
            wing.estimates[estimate.kind] = estimate
        for truth in self._series_of(TruthSeries):
            wings.setdefault(truth.wing, WingData(truth.wing)).truth = truth
        if not wings:
            wings = {one.wing.name: WingData(one.wing.name) for one in self.config.wing_configs}
        return wings

    @cached_property
    def cameras(self) -> dict[str, CameraData]:
        """Tracks and frames by name of the camera, in order of appearance."""
        cameras: dict[str, CameraData] = {}
        for tracks in self._series_of(TrackSeries):
            cameras.setdefault(tracks.camera, CameraData(tracks.camera)).tracks = tracks
        for frames in self._series_of(Frames):
            cameras.setdefault(frames.camera, CameraData(frames.camera)).frames = frames
        return cameras

    def _series_of(self, kind: type[T]) -> list[T]:
        return [one for one in self._contents.series.values() if isinstance(one, kind)]

    @property
    def health(self) -> HealthSeries:
        """Counters of all sources."""
        found = self._contents.series.get(HEALTH)
        return found if isinstance(found, HealthSeries) else HealthCollector().series()

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened once, in the order of the log."""
        found = self._contents.series.get(EVENT)
        return found if isinstance(found, tuple) else ()

    @property
    def wing(self) -> WingData:
        """The wing of a flight with one wing.

        Raises
        ------
        RecordingError
            If the log holds estimates or truth of no wing, or of several.
        """
        return self._only("wings", self.wings)

    def wing_named(self, name: str | None = None) -> WingData:
        """Return a wing, by default the only one.

        Raises
        ------
        RecordingError
            If the log holds nothing of it, or several wings and no name is given.
        """
        if name is None:
            return self.wing
        return self._there(f"wing '{name}'; it has {', '.join(self.wings)}", self.wings.get(name))

    @property
    def camera(self) -> CameraData:
        """The camera of a flight with one camera.

        Raises
        ------
        RecordingError
            If the log holds tracks or frames of no camera, or of several.
        """
        return self._only("cameras", self.cameras)

    def camera_of(self, wing: WingData) -> CameraData | None:
        """Return what the log holds of the camera that looks at a wing; None if nothing."""
        if len(self.cameras) == 1 and len(self.wings) == 1:
            return self.camera
        camera = config_of_wing(self.config, wing.name).camera
        return None if camera is None else self.cameras.get(camera.name)

    def _only(self, what: str, items: Mapping[str, T]) -> T:
        if len(items) == 1:
            return next(iter(items.values()))
        if not items:
            msg = f"{self.path}: holds no records of {what}"
        else:
            msg = f"{self.path}: holds {what} {', '.join(items)}; choose one: .{what}[NAME]"
        raise RecordingError(msg)

    @property
    def estimates(self) -> dict[str, EstimateSeries]:
        """Estimates of the only wing, by kind: ``flight.estimates["crg"]``."""
        return self.wing.estimates

    @property
    def truth(self) -> TruthSeries:
        """The true shape of the only wing.

        Raises
        ------
        RecordingError
            If the log holds none.
        """
        return self._there("truth", self.wing.truth)

    @property
    def tracks(self) -> TrackSeries:
        """The marker tracks of the only camera.

        Raises
        ------
        RecordingError
            If the log holds none.
        """
        return self._there("marker tracks", self.camera.tracks)

    def frames(self, camera: str | None = None) -> Frames:
        """Return the frames of a camera, by default of the only one.

        Raises
        ------
        RecordingError
            If the log holds none.
        """
        found = self.camera if camera is None else self.cameras.get(camera, CameraData(camera))
        return self._there(f"frames of camera {found.name}", found.frames)

    def _there(self, what: str, found: T | None) -> T:
        if found is None:
            msg = f"{self.path}: holds no {what}"
            raise RecordingError(msg)
        return found

    @cached_property
    def tables(self) -> dict[str, Table]:
        """The tables that ``avionics export`` writes, by name: "imu_0", "estimate_crg", ..."""
        return tables_of(self.by_topic, self.config)

    def table(self, name: str) -> Table:
        """Return one topic as a table with a column per quantity, units in the names.

        Parameters
        ----------
        name : str
            A topic, or the name of a table as ``tables`` has it.

        Raises
        ------
        RecordingError
            If the log holds no such topic or table.
        """
        for table in self.tables.values():
            if name in {table.topic, table.name}:
                return table
        msg = f"{self.path}: holds no table '{name}'; it has {', '.join(self.tables)}"
        raise RecordingError(msg)


def read_flight(path: str | PathLike[str], topics: Collection[str] | None = None) -> Flight:
    """Return a flight's log as arrays.

    Parameters
    ----------
    path : path
        The log; may be cut or damaged, then ``Flight.damage`` lists what is missing.
    topics : collection of str, optional
        Topics or patterns such as ``/imu/*`` that become arrays; None = all. The others are
        counted in ``Flight.topics``.

    Returns
    -------
    Flight
        Nothing but the head of the file is read until an array is asked for.

    Raises
    ------
    RecordingError
        If it is no log of ours.

    Examples
    --------
    >>> flight = read_flight("flight.mcap")
    >>> flight.imu["1"].rate_rad_s.mean(axis=0)
    >>> flight.estimates["crg"].tip_in_body_m[:, 2]
    >>> flight.table("estimate_crg").to_pandas()

    Notes
    -----
    A record costs the bytes of its numbers, and an eighth more at most: 56 bytes for a sample of a
    gyro alone, 1.1 kB for an estimate of seven modes, two pods, 21 points and six markers, 40 bytes
    for a picture of any size. Events and names are kept as they are.
    """
    return Flight(Path(path), topics)

"""What a log holds of a camera: times and tracks at once, the pixels when someone looks."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from avionics.analysis.columns import Numbers
from avionics.analysis.series import TimeArray, TrackSeries, seconds
from avionics.errors import RecordingError
from avionics.recording.reader import LogReader, RawChannelMessage
from avionics.recording.schema.decode import DECODER_OF, exposure_ns
from avionics.recording.schema.messages import MESSAGE_OF, schema_name
from avionics.records import EncodedFrame, FloatArray
from drivers.samples import Frame

IMAGE_SCHEMA = schema_name(MESSAGE_OF[EncodedFrame])


class Frames:
    """The frames of one camera, ``/camera/<name>/image``, in the order of the log.

    Iterating yields frames with their pixels, one at a time; ``frames[row]`` reads one. Either
    reads the chunk of the log that holds the picture, and keeps that one chunk for the next.

    Attributes
    ----------
    topic, camera : str
        The topic and the name of the camera.
    t_ns, arrival_ns : ndarray of int64, shape (n,)
        Middle of the exposure, and arrival, ns of the steady clock.
    t_s : ndarray, shape (n,)
        ``t_ns`` as seconds since the start of the flight.
    index : ndarray of int64, shape (n,)
        The source's own number of each frame; a gap is a lost frame.
    """

    def __init__(
        self,
        reader: LogReader,
        topic: str,
        channel: int,
        start_ns: int,
        columns: dict[str, TimeArray],
    ) -> None:
        self.topic, self.camera = topic, topic.split("/")[2]
        self.t_ns, self.arrival_ns = columns["t_ns"], columns["arrival_ns"]
        self.t_s: FloatArray = seconds(self.t_ns, start_ns)
        self.index, self._offset = columns["index"], columns["offset"]
        self._reader, self._channel = reader, channel
        self._chunk: tuple[int, dict[tuple[int, int], bytes]] = (-1, {})

    def __repr__(self) -> str:
        """Return topic and number of frames."""
        return f"<Frames {self.topic}: {len(self)}>"

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.t_ns)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, one at a time."""
        return (self[row] for row in range(len(self)))

    def __getitem__(self, row: int) -> Frame:
        """Return the frame in a row.

        Raises
        ------
        IndexError
            If there is no such row.
        RecordingError
            If the picture cannot be decoded, or the file is another one by now.
        """
        offset, index = int(self._offset[row]), int(self.index[row])
        if self._chunk[0] != offset:
            self._chunk = (offset, self._pictures(offset))
        data = self._chunk[1].get((int(self.arrival_ns[row]), index))
        if data is None:
            msg = f"{self._reader.path}: frame {index} of camera {self.camera} is no longer there"
            raise RecordingError(msg)
        frame = DECODER_OF[IMAGE_SCHEMA](data, index, self._reader.utc_offset_ns)
        assert isinstance(frame, EncodedFrame)
        return frame.decode()

    def _pictures(self, offset: int) -> dict[tuple[int, int], bytes]:
        """Return the compressed pictures of a chunk by arrival and number."""
        offset_ns = self._reader.utc_offset_ns
        return {
            (message.log_ns - offset_ns, message.sequence): message.data
            for message in self._reader.messages_at(offset)
            if message.channel == self._channel
        }

    def with_index(self, index: int) -> Frame:
        """Return the frame that the source gave a number.

        Raises
        ------
        RecordingError
            If the log holds no such frame.
        """
        rows = np.flatnonzero(self.index == index)
        if not rows.size:
            msg = f"{self._reader.path}: holds no frame {index} of camera {self.camera}"
            raise RecordingError(msg)
        return self[int(rows[0])]


@dataclass(slots=True, eq=False)
class CameraData:
    """What a log holds of one camera.

    Attributes
    ----------
    name : str
        Name of the camera.
    tracks : TrackSeries or None
        Where the markers were found.
    frames : Frames or None
        Its pictures.
    """

    name: str
    tracks: TrackSeries | None = None
    frames: Frames | None = None

    def exposures_ns(self) -> TimeArray:
        """Return every exposure of which there are tracks or a picture, once, increasing, ns."""
        known = [one.t_ns for one in (self.tracks, self.frames) if one is not None]
        return np.unique(np.concatenate(known)) if known else np.empty(0, dtype=np.int64)


class FrameCollector:
    """Takes the images of one topic while a log is read: times and places, no pictures."""

    def __init__(self, reader: LogReader, found: RawChannelMessage) -> None:
        self._reader, self._topic = reader, found.channel.topic
        self._channel = found.message.channel
        names = ("t_ns", "arrival_ns", "index", "offset")
        self._columns = {name: Numbers(np.int64) for name in names}

    def take(self, found: RawChannelMessage) -> None:
        """Take one message.

        Raises
        ------
        DecodeError
            If it is no image.
        """
        utc_offset_ns, message = self._reader.utc_offset_ns, found.message
        t_ns = exposure_ns(message.data, utc_offset_ns)
        row = (t_ns, message.log_ns - utc_offset_ns, message.sequence, found.offset)
        for column, value in zip(self._columns.values(), row, strict=True):
            column.append(value)

    def times(self) -> TimeArray:
        """Return the exposures; none can be taken after that."""
        return self._columns["t_ns"].frozen()

    def frames(self, start_ns: int) -> Frames:
        """Return the frames; ``start_ns`` is the start of the flight."""
        columns = {name: column.frozen() for name, column in self._columns.items()}
        return Frames(self._reader, self._topic, self._channel, start_ns, columns)

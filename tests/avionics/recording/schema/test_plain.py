"""Records without code of their own: the absent stays absent, differing fields are named."""

from dataclasses import dataclass

import numpy as np
import pytest

from avionics.recording.schema.plain import PlainRecord
from avionics.recording.schema.proto import records_pb2
from drivers.samples import ImuSample

PLAIN = PlainRecord(ImuSample, records_pb2.ImuSample)


def test_vectors_come_back_bit_for_bit() -> None:
    rate = np.array([np.nan, -0.0, 5e-324])
    sample = ImuSample(-1, "root", 2**40, rate, None, np.array([1.0, 2.0, 3.0]))
    back = PLAIN.decode(PLAIN.encode(sample, 0), 0, 0)
    assert (back.t_ns, back.pod, back.seq) == (-1, "root", 2**40)
    assert back.rate_rad_s.tobytes() == rate.tobytes()
    assert back.specific_force_m_s2 is None
    assert back.magnetic_flux_t.tolist() == [1.0, 2.0, 3.0]


def test_vector_that_must_be_there_may_be_empty() -> None:
    back = PLAIN.decode(PLAIN.encode(ImuSample(0, "", 0, np.empty(0)), 0), 0, 0)
    assert back.rate_rad_s.shape == (0,)


def test_record_and_message_that_differ_are_refused() -> None:
    @dataclass
    class Other:
        t_ns: int
        pod: str
        temperature_k: float

    with pytest.raises(TypeError, match=r"Other and message avionics.ImuSample differ in: .*seq"):
        PlainRecord(Other, records_pb2.ImuSample)

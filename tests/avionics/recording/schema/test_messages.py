import re
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool

from avionics.recording.schema.messages import (
    MESSAGE_OF,
    from_timestamp,
    schema_bytes,
    schema_name,
    to_timestamp,
)
from avionics.recording.schema.proto import records_pb2
from tests.compile_proto import describe

ROOT = Path(__file__).parents[4]
PROTO = ROOT / "avionics/recording/schema/proto/records.proto"


def test_generated_code_matches_its_source() -> None:
    described = describe(PROTO.read_text(encoding="utf-8"))
    assert records_pb2.DESCRIPTOR.serialized_pb == described.SerializeToString()


def test_generated_code_is_what_the_compiler_makes(tmp_path: Path) -> None:
    protoc = pytest.importorskip("grpc_tools.protoc", reason="grpcio-tools is not installed")
    done = protoc.main(
        ["protoc", f"-I{ROOT}", f"--python_out={tmp_path}", str(PROTO.relative_to(ROOT))]
    )
    assert done == 0
    made = (tmp_path / "avionics/recording/schema/proto/records_pb2.py").read_text()
    committed = (PROTO.parent / "records_pb2.py").read_text()
    serialized = re.compile(r"AddSerializedFile\((.*)\)")
    assert serialized.search(made).group(1) == serialized.search(committed).group(1)


@pytest.mark.parametrize("record", MESSAGE_OF)
def test_the_schema_in_the_log_is_self_contained(record: type) -> None:
    message = MESSAGE_OF[record]
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(schema_bytes(message)).file:
        pool.Add(file)
    found = pool.FindMessageTypeByName(schema_name(message))
    assert [f.name for f in found.fields] == [f.name for f in message.DESCRIPTOR.fields]


@pytest.mark.parametrize("utc_ns", [0, 1, -1, 1_699_999_999_999_875_514, -(10**18) - 7])
def test_times_survive_to_the_nanosecond(utc_ns: int) -> None:
    assert from_timestamp(to_timestamp(utc_ns)) == utc_ns

"""records.proto to records_pb2.py without protoc: enough of the compiler for our own schema."""

import re
from pathlib import Path

from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto

PROTO = "avionics/recording/schema/proto/records.proto"
SERIALIZED = re.compile(r"AddSerializedFile\((b'.*')\)")


def compile_records(tree: Path) -> None:
    """Write records_pb2.py of a tree's records.proto."""
    generated = (tree / PROTO).with_name("records_pb2.py")
    text = generated.read_text(encoding="utf-8")
    described = describe((tree / PROTO).read_text(encoding="utf-8")).SerializeToString()
    start = text.index("if _descriptor._USE_C_DESCRIPTORS == False:")
    # The part left out serves protobuf's pure-Python form, which needs the compiler's offsets.
    text = SERIALIZED.sub(lambda _: f"AddSerializedFile({described!r})", text[:start])
    generated.write_text(text, encoding="utf-8")


def describe(source: str) -> FileDescriptorProto:
    """Return what a schema of messages with scalar fields and maps of counters describes."""
    file = FileDescriptorProto(name=PROTO, package="avionics", syntax="proto3")
    for name, body in re.findall(r"message (\w+) \{(.*?)\}", _plain(source), re.DOTALL):
        message = file.message_type.add(name=name)
        for many, kind, field, number in re.findall(
            r"(repeated |)(map<string, int64>|\w+) (\w+) = (\d+);", body
        ):
            added = message.field.add(name=field, number=int(number))
            is_map = kind.startswith("map")
            repeated = many or is_map
            added.label = (
                FieldDescriptorProto.LABEL_REPEATED
                if repeated
                else FieldDescriptorProto.LABEL_OPTIONAL
            )
            if is_map:
                entry = message.nested_type.add(name=f"{field.capitalize()}Entry")
                for i, (key, entry_kind) in enumerate((("key", "string"), ("value", "int64"))):
                    part = entry.field.add(name=key, number=i + 1)
                    part.label = FieldDescriptorProto.LABEL_OPTIONAL
                    part.type = _type(entry_kind)
                entry.options.map_entry = True
                added.type = FieldDescriptorProto.TYPE_MESSAGE
                added.type_name = f".avionics.{name}.{entry.name}"
            else:
                added.type = _type(kind)
    return file


def _plain(source: str) -> str:
    return re.sub(r"//.*", "", source)


def _type(kind: str) -> FieldDescriptorProto.Type.ValueType:
    return FieldDescriptorProto.Type.Value(f"TYPE_{kind.upper()}")

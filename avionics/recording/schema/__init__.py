"""Records as protobuf and back; ``proto/records.proto`` holds our own messages."""

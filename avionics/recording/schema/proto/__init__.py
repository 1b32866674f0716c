"""Generated protobuf classes of our own records; ``records.proto`` beside them is the source."""

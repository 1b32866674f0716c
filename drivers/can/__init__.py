"""CAN: ports, error frames, and the pods as sources of samples."""

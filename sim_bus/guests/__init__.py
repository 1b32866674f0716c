"""A kernel of our own for tests: real SocketCAN, /dev/i2c-N and tty without hardware or root."""

"""MCAP on the byte level: chunks that survive a power cut, and files read back though damaged."""

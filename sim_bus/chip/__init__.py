"""Simulated sensor chips, true to the register."""

"""Calibration: lens from chessboards, pose from markers of known position. Pure computations."""

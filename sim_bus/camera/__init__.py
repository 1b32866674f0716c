"""The simulated camera: lens, picture and chessboards."""

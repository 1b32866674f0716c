"""Recorded data of others: formats in, one log out."""

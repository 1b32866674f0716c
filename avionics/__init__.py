"""Avionics data logger and wing-shape estimator for flexible wings."""

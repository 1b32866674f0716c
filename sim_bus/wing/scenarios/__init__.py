"""Flights that come with the package; see ``sim_bus.wing.scenario``."""

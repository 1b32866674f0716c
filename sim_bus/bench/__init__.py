"""The bench: the simulated wing in real time behind real or virtual interfaces."""

"""Wing pods on CAN: the wire layout (``pod.dbc``), its codec and the pods' time."""

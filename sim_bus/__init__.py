"""A wing, its chips and its buses, in software: behind the drivers' real interfaces."""

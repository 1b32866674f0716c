"""``python -m avionics``."""

from avionics.cli import main

if __name__ == "__main__":
    main()

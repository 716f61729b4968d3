"""`python -m motion_transfer` is `mt`."""

from motion_transfer.cli.main import entry_point

if __name__ == "__main__":
    entry_point()

"""``python -m heelstrike``: the command, where no script of it is on the path."""

from heelstrike.cli import run

if __name__ == "__main__":  # and not in the processes that a campaign starts
    run()

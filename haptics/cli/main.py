"""Where the ``haptics`` command begins. It loads the commands when it can already be ended in order: that takes a while."""

from __future__ import annotations

from typing import Any

from haptics.cli.program import run_program


def main() -> None:
    """Run the command line; errors meant for a person become lines on standard error, and whoever asks to end it is obeyed."""
    run_program(_command_line)


def _command_line() -> None:
    from haptics.cli.commands import command_line

    command_line()


def __getattr__(name: str) -> Any:
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from haptics.cli.commands import app

    return app


if __name__ == "__main__":
    main()

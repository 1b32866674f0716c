"""The `avionics` command: its groups, and how an error reaches the person at the terminal."""

import sys
from typing import Annotated, Any, NoReturn

import typer

from avionics.cli import desk, fly, pos, rig
from avionics.errors import AvionicsError, OutputExistsError
from drivers.errors import DriverError

app = typer.Typer(
    help="Avionics data logger and wing-shape estimator for flexible wings.\n\n"
    "Example: avionics sim --duration 10 -o sim.mcap",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
fly.register(app)
desk.register(app)
app.add_typer(rig.app, name="rig", rich_help_panel="Test and study")
app.add_typer(pos.app, name="pos", rich_help_panel="Test and study")


# The parent of every error of the command line, wherever this version of the library keeps it.
COMMAND_LINE_ERROR: type[Exception] = typer.BadParameter.__mro__[2]


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 (start-up)

        try:
            print(version("wing-avionics"))
        except PackageNotFoundError:
            print("unknown (not installed)")
        raise typer.Exit


@app.callback()
def _root(
    show_version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Avionics data logger and wing-shape estimator for flexible wings."""


def main() -> None:
    """Run the command; errors go to stderr in a line or two.

    Exit status: 0 success, 1 the work failed, 2 the command line or an existing output file.
    """
    try:
        status = app(standalone_mode=False)
    except typer.Abort:
        _fail("interrupted", 130)
    except COMMAND_LINE_ERROR as error:
        _fail_usage(error)
    except OutputExistsError as error:
        _fail(error, 2)
    except (AvionicsError, DriverError) as error:
        _fail(error, 1)
    except BrokenPipeError:
        # The reader of our output went away (`| head`); that is no failure to talk about.
        sys.stderr.close()
        sys.exit(1)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        _fail(f"{where}{error.strerror or error}", 1)
    except KeyboardInterrupt:
        _fail("interrupted", 130)
    else:
        if status == 130:
            _fail("interrupted", 130)
        sys.exit(status)


def _fail_usage(error: Any) -> NoReturn:
    """Say what is wrong with the command line, and which help to read."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        sys.exit(error.exit_code)
    command = error.ctx.command_path if getattr(error, "ctx", None) else "avionics"
    message = " ".join(error.format_message().split()).removesuffix(".")
    _fail(f"{message}; see {command} --help", error.exit_code)


def _fail(error: object, status: int) -> NoReturn:
    print(f"avionics: {error}", file=sys.stderr)
    sys.exit(status)

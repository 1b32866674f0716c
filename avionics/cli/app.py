"""The `avionics` command: its groups, and how an error reaches the person at the terminal."""

import sys
from typing import Annotated

import typer

from avionics.cli import desk, fly, pos, rig
from avionics.errors import AvionicsError, OutputExistsError
from drivers.errors import DriverError

app = typer.Typer(
    help="Avionics data logger and wing-shape estimator for flexible wings.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
fly.register(app)
desk.register(app)
app.add_typer(rig.app, name="rig")
app.add_typer(pos.app, name="pos")


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
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print version."),
    ] = False,
) -> None:
    """Avionics data logger and wing-shape estimator for flexible wings."""


def main() -> None:
    """Run the command; errors go to stderr in a line or two.

    Exit status: 0 success, 1 the work failed, 2 the command line or an existing output file.
    """
    try:
        app()
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


def _fail(error: object, status: int) -> None:
    print(f"avionics: {error}", file=sys.stderr)
    sys.exit(status)

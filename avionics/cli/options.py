"""Arguments and options that several commands share: one name, one type, one help text each."""

from pathlib import Path
from typing import Annotated

import typer

ConfigArgument = Annotated[
    Path, typer.Argument(metavar="CONFIG.toml", help="Configuration of the wing.")
]
ConfigOrPackaged = Annotated[
    Path | None,
    typer.Argument(metavar="CONFIG.toml", help="Configuration; default: the packaged wing."),
]
LogArgument = Annotated[Path, typer.Argument(metavar="LOG.mcap", help="Log to read.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the configuration, e.g. estimator.form=paper; may be repeated.",
    ),
]
OutputFile = Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="File to write.")]
OutputFolder = Annotated[
    Path, typer.Option("-o", "--output", metavar="FOLDER", help="Folder for the results.")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite output that exists.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]
Seed = Annotated[int, typer.Option(min=0, metavar="N", help="Seed of every random draw.")]
Control = Annotated[
    Path | None,
    typer.Option(
        "--control",
        metavar="SOCKET",
        help="Control socket of the bench; default: this user's.",
    ),
]

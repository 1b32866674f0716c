"""Write docs/configuration.md from the configuration's own types and docstrings."""

import types
import typing
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from avionics.config import Config
from avionics.config.load import default_config_text

HEAD = """# Configuration

One TOML file decides what flies. Unknown keys are errors. `--set key=value` changes a key for one
run, e.g. `--set estimator.form=paper`. The resolved whole is attached to every log. A top-level
`calibration = { path = "camera.toml", sha256 = "..." }` names a file whose keys replace these.

A flight carries one wing, `[wing]` with `[[pods]]`, `[[markers]]` and `[camera]` beside it, or
several of one aircraft: `[[wings]]`, each with these tables within it (see the end of the page).

This page is made from the types in `avionics/config/`: `python docs/make_configuration.py`.
"""

WINGS = """## `[[wings]]`

Several wings of one aircraft fly in one log: a pipeline each, one clock, and one IMU at the root
(`[root]`, the pod "root" in a log) whose rates are taken off every wing. A `[[wings]]` holds the
keys of `[wing]`, `name` being needed, and its own tables: `[[wings.pods]]`, `[[wings.markers]]`,
`[[wings.truth_markers]]`, `[wings.camera]`, and `calibration` for its camera. Estimator, tracker,
recorder and root are shared and stand at the top. Names of wings and of cameras and the ids of pods
are unique over the flight, marker ids within a wing. `--set wings.left.camera.tilt_deg=-12` changes
a key of one wing.

A left wing is the right one mirrored in y: its local axes point as the mirrored ones do (x forward,
y inboard, z down), angles and loads read as a right wing's, and all that is reported in body axes
(camera, markers, line, truth) has y to the right. Its camera looks along -y at `pan_deg = 180`.

"""


def sections(model: type[BaseModel], path: str) -> list[tuple[str, type[BaseModel]]]:
    """Return every table below a model with its place in the file."""
    found = []
    for name, field in model.model_fields.items():
        for inner in models_in(field.annotation):
            many = "tuple" in str(field.annotation)
            place = f"{path}.{name}" if path else name
            kind = inner.model_fields.get("kind")
            label = f"[[{place}]]" if many else f"[{place}]"
            if kind is not None:
                (tag,) = typing.get_args(kind.annotation)
                label += f' kind = "{tag}"'
            found += [(label, inner), *sections(inner, place)]
    return found


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the tables that an annotation admits."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for part in typing.get_args(annotation) for m in models_in(part)]


def type_text(annotation: Any) -> str:
    """Return a type as a person writes it."""
    origin, parts = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Literal:
        return " or ".join(f"`{value!r}`".replace("'", '"') for value in parts)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(type_text(part) for part in parts if part is not type(None))
    if origin is tuple:
        return "list of " + type_text(parts[0])
    if origin is typing.Annotated:
        return type_text(parts[0])
    names = {float: "number", int: "integer", str: "text", bool: "true or false"}
    return names.get(annotation, str(getattr(annotation, "__name__", annotation)))


def default_text(field: FieldInfo) -> str:
    """Return a default as the file would hold it."""
    value = field.default
    if value is PydanticUndefined:
        return "**needed**"
    if value is None or isinstance(value, (BaseModel, tuple)):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def page() -> str:
    """Return the whole page."""
    lines = [HEAD]
    for label, model in sections(Config, ""):
        lines += [f"## `{label}`", "", (model.__doc__ or "").strip(), ""]
        lines += ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
        for name, field in model.model_fields.items():
            if name == "kind" or models_in(field.annotation):
                continue
            text = f"{type_text(field.annotation)} | {default_text(field)}"
            lines.append(f"| `{name}` | {text} | {field.description or ''} |")
        lines.append("")
    lines += [WINGS.rstrip(), ""]
    lines += ["## The packaged example", "", "```toml", default_config_text().rstrip(), "```", ""]
    return "\n".join(lines)


if __name__ == "__main__":
    Path(__file__).with_name("configuration.md").write_text(page(), encoding="utf-8")

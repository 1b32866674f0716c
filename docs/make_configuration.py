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

This page is made from the types in `avionics/config/model.py`: `python docs/make_configuration.py`.
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
    lines += ["## The packaged example", "", "```toml", default_config_text().rstrip(), "```", ""]
    return "\n".join(lines)


if __name__ == "__main__":
    Path(__file__).with_name("configuration.md").write_text(page(), encoding="utf-8")

"""What outputs are called: templates, and the conventions of published sets."""

from __future__ import annotations

import posixpath
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fogpipe.batch.variation import Variant
from fogpipe.datasets.item import Item
from fogpipe.errors import OutputError, RequestError, suggestion


@dataclass(frozen=True)
class Layout:
    """Where the files of one variant go, relative to the root of the outputs.

    Attributes
    ----------
    picture : template of the picture; its ending names the format.
    extra : template, without ending, of a file beside it; has the fields ``output`` and ``stem``, which is ``picture``
        filled in, without its ending.
    renamed : what outputs are called in names, where a set has a word of its own.
    clear : template of a copy of the clear picture, or empty.
    """

    picture: str
    extra: str = "{stem}_{output}"
    renamed: tuple[tuple[str, str], ...] = ()
    clear: str = ""

    def called(self, output: str) -> str:
        """What this layout calls an output."""
        return dict(self.renamed).get(output, output)


PRESETS = {
    "foggy-cityscapes": Layout(
        picture="leftImg8bit_foggy/{id}_leftImg8bit_foggy_beta_{extinction:.4g}.png",
        extra="leftImg8bit_{output}/{id}_leftImg8bit_{output}_beta_{extinction:.4g}",
        renamed=(("transmission", "transmittance"),),
    ),
    "reside": Layout(
        picture="hazy/{name}_{airlight:.2g}_{extinction:.3g}.png",
        extra="{output}/{name}_{airlight:.2g}_{extinction:.3g}",
        renamed=(("transmission", "trans"),),
        clear="clear/{name}{suffix}",
    ),
}
"""Layouts by name: Foggy Cityscapes (Sakaridis 2018), and RESIDE (Li 2019) with the names of its outdoor set."""

KNOWN_BEFORE = ("path", "id", "name", "folder", "suffix", "draw")
"""Fields that do not depend on the pipeline: path and ending of the picture, the id and its two parts, the draw."""


class _Fields(string.Formatter):
    """Fills in fields by their whole name, dots included; nothing is looked up in the values themselves."""

    def get_field(self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> tuple[Any, str]:
        if field_name not in kwargs:
            raise RequestError(f'has no field "{field_name}".{suggestion(field_name, kwargs)}')
        return kwargs[field_name], field_name

    def format_field(self, value: Any, format_spec: str) -> str:
        return format(value, format_spec or ("g" if isinstance(value, float) else ""))


def layout_from(preset: str | None, template: str | None, parameters: Sequence[str], draws: int, suffix: str) -> Layout:
    """The layout that is asked for; by default names mirror the input and tell every parameter that differs.

    Raises
    ------
    RequestError
        If the preset is unknown, or a template comes with a preset.
    """
    if preset and template:
        raise RequestError("--names and --preset say the same thing; give one of them.")
    if preset:
        if preset not in PRESETS:
            raise RequestError(f"--preset {preset}: there is no such layout.{suggestion(preset, PRESETS)}")
        return PRESETS[preset]
    if template:
        return Layout(template)
    differing = "".join(f"_{name.rpartition('.')[2]}{{{name}}}" for name in parameters)
    return Layout("{path}" + differing + ("_{draw}" if draws > 1 else "") + suffix)


def fields_of(template: str) -> set[str]:
    """Names of the fields of a template; RequestError where it is not one."""
    try:
        return {name for _, name, _, _ in string.Formatter().parse(template) if name is not None}
    except ValueError as error:
        raise RequestError(f'the template "{template}" cannot be read: {error}.') from error


def filled(template: str, values: Mapping[str, Any]) -> str:
    """A template filled in: a path below the root of the outputs.

    Raises
    ------
    RequestError
        If a field is unknown, or its format does not fit its value.
    OutputError
        If the path is empty, absolute, or leads out of the root.
    """
    try:
        text = _Fields().vformat(template, (), values)
    except RequestError as error:
        raise RequestError(f'the template "{template}" {error}') from None
    except (ValueError, TypeError, LookupError) as error:
        raise RequestError(f'the template "{template}" cannot be filled in: {error}.') from error
    if text.startswith(".fogpipe"):
        raise OutputError(f'the template "{template}" gives "{text}", a name that is kept for fogpipe itself.')
    return inside(text, f'the template "{template}" gives')


def inside(path: str, where: str) -> str:
    """The path itself, if it stays below the root; OutputError otherwise."""
    parts = path.replace("\\", "/").split("/")
    if (
        posixpath.isabs(path)
        or ":" in parts[0]
        or not all(parts)
        or any(part in (".", "..") for part in parts)
        or "\0" in path
    ):
        raise OutputError(f'{where} "{path}", which is not a path below the folder of the outputs.')
    return path


def known_values(item: Item, variant: Variant) -> dict[str, Any]:
    """Fields that are known before anything runs: those of the item, and parameters by full and by last name."""
    folder, _, name = item.id.rpartition("/")
    ending = posixpath.splitext(posixpath.basename(item.files.get("image", "")))[1]
    last = {key.rpartition(".")[2]: value for key, value in variant.settings.items()}
    own = {"path": item.path or item.id, "id": item.id, "name": name, "folder": folder, "suffix": ending}
    return {**last, **variant.settings, **own, "draw": variant.draw}

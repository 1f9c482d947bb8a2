# SPDX-License-Identifier: GPL-3.0-or-later
"""HTML pages from Jinja2 templates. Every value is escaped unless it is marked as HTML already."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def render_html(template: Path, **values: Any) -> str:
    """Return the text of a template with its values filled in.

    Parameters
    ----------
    template : Path
        File of the template. It may include others from its folder.
    values
        Variables of the template. Missing ones are an error.

    Raises
    ------
    jinja2.TemplateError
        The template is broken, or uses a variable that is not among `values`.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(template.parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(template.name).render(**values)

# SPDX-License-Identifier: GPL-3.0-or-later
"""HTML pages from Jinja2 templates. Every value is escaped unless it is marked as HTML already."""

from __future__ import annotations

import html
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
    from markupsafe import Markup

    def escaped(value: Any) -> Markup:
        """Escape as Python's own ``html.escape`` does: `&quot;` and `&#x27;`, not the numbers that MarkupSafe writes."""
        return value if isinstance(value, Markup) else Markup(html.escape(str(value)))

    environment = Environment(
        loader=FileSystemLoader(template.parent),
        autoescape=True,
        finalize=escaped,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(template.name).render(**values)

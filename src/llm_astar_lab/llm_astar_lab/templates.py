# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Texts made by the templates that lie beside the code that fills them."""

from jinja2 import Environment, PackageLoader, select_autoescape

TEMPLATES = Environment(
    loader=PackageLoader('llm_astar_lab', '.'),
    autoescape=select_autoescape(['html.j2']),
    trim_blocks=True,
    lstrip_blocks=True,
)


def render(template: str, **values: object) -> str:
    """Return the text that a template makes of values; its name is ROOM/FILE."""
    text: str = TEMPLATES.get_template(template).render(values)
    return text

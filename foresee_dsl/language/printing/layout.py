"""How each class of the model is written: one function a class, in the modules that are imported here."""

from __future__ import annotations

from foresee_dsl.language.printing import actors, children, networks, scenarios, triggers
from foresee_dsl.language.printing.registry import Layout, layout

__all__ = ["Layout", "actors", "children", "layout", "networks", "scenarios", "triggers"]

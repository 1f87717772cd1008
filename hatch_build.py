"""The page goes into wheel, sdist and editable installs; it is built when it is missing."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).resolve().parent


def _bundle() -> Any:
    sys.path.insert(0, str(ROOT / "web"))
    import bundle

    return bundle


class PageHook(BuildHookInterface):  # type: ignore[type-arg, misc]
    """Builds the page where it is missing."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Node as a package, where the page is missing and the system has no node."""
        bundle = _bundle()
        return [] if bundle.ready() or bundle.find_node() else [bundle.WHEEL]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Make the bundle unless it is there."""
        bundle = _bundle()
        try:
            bundle.build_if_missing()
        except bundle.BundleError as error:
            self.app.abort(str(error))

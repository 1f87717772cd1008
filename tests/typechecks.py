"""How types are checked while tests run; a module of its own, for the import hook asks for it by name."""

from __future__ import annotations

from pathlib import Path

from beartype import BeartypeConf, beartype

typechecked = beartype(conf=BeartypeConf(is_pep484_tower=True))  # an int will do where a float is asked for

SOURCES = Path(__file__).resolve().parent.parent / "src"

# numba compiles these: a wrapped function is none that it can read
COMPILED = ("kernels",)


def checked_modules() -> list[str]:
    """Every module of the package whose shapes and types are checked while tests run (packages only re-export)."""
    names = []
    for path in sorted(SOURCES.rglob("*.py")):
        compiled = path.stem in COMPILED or path.stem.endswith("_kernels")
        if path.stem not in ("__init__", "__main__") and not compiled:
            names.append(".".join(path.relative_to(SOURCES).with_suffix("").parts))
    return names

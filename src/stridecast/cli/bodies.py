"""Options of commands that write motion: whose body, and for which program."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Bool

    from stridecast.formats.bvh_conventions import BvhConvention
    from stridecast.model.motion import Motion
    from stridecast.model.skeleton import Skeleton

LEGS = (0.15, 4.0)
"""Of characters that can walk, thigh and shin in metres; longer or shorter ones are in another unit."""

CharacterOption = Annotated[
    Path | None,
    typer.Option(
        "--skeleton",
        metavar="CHARACTER.bvh|.glb|.vrm",
        help="Play it on this character's skeleton; else on the database's.",
    ),
]
CompactOption = Annotated[
    bool, typer.Option("--compact", help="A GLB of half the size: rotations as numbers of 16 bits.")
]

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


@dataclass(frozen=True, kw_only=True)
class BvhOptions:
    """How BVH is to be written; each field is an option of a command ``with_bvh_options``."""

    bvh_for: Annotated[
        str | None,
        typer.Option("--bvh-for", metavar="blender|motionbuilder|unreal", help="Write BVH as this program expects it."),
    ] = None
    bvh_unit: Annotated[
        str | None,
        typer.Option("--bvh-unit", metavar="m|cm|mm|METRES", help="Unit of length; else the program's, or m."),
    ] = None
    bvh_order: Annotated[
        str | None, typer.Option("--bvh-order", metavar="ZYX", help="Order of rotation channels; else ZYX.")
    ] = None
    bvh_up: Annotated[str | None, typer.Option("--bvh-up", metavar="Y|Z", help="Axis that points up; else Y.")] = None
    bvh_root: Annotated[
        str | None,
        typer.Option(
            "--bvh-root", metavar="zero|standing|ground", help="OFFSET of the root, or a joint on the floor below it."
        ),
    ] = None
    bvh_rest: Annotated[
        bool | None, typer.Option("--bvh-rest/--no-bvh-rest", help="Begin with a frame in the rest pose, or not.")
    ] = None

    def convention(self, output: Path | None) -> BvhConvention:
        """The same for a file.

        Raises
        ------
        InputError
            Options that are none, or no BVH is written.
        """
        from stridecast.errors import InputError
        from stridecast.formats.bvh_conventions import bvh_convention

        named = [f"--{name.replace('_', '-')}" for name, value in vars(self).items() if value is not None]
        if named and (output is None or output.suffix.lower() != ".bvh"):
            raise InputError(f"{named[0]} goes with an output *.bvh")
        return bvh_convention(
            self.bvh_for or "plain",
            order=self.bvh_order,
            scale=None if self.bvh_unit is None else _metres(self.bvh_unit),
            up=self.bvh_up,
            root=self.bvh_root,
            rest_frame=self.bvh_rest,
        )


def with_bvh_options(command: Callable[..., None]) -> Callable[..., None]:
    """A command whose parameter ``bvh`` is made of an option for each field of ``BvhOptions``."""
    own = inspect.signature(command, eval_str=True)
    options = inspect.signature(BvhOptions, eval_str=True).parameters
    spread: list[inspect.Parameter] = []
    for name, parameter in own.parameters.items():
        spread += options.values() if name == "bvh" else [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)]

    @functools.wraps(command)
    def called(**given: Any) -> None:
        bvh = BvhOptions(**{name: given.pop(name) for name in options})
        command(bvh=bvh, **given)

    called.__signature__ = own.replace(parameters=spread)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in spread}
    return called


def _metres(unit: str) -> float:
    from stridecast.errors import InputError

    if unit in UNITS:
        return UNITS[unit]
    try:
        return float(unit)
    except ValueError:
        raise InputError(f"--bvh-unit must be {', '.join(UNITS)} or a number of metres, not {unit!r}") from None


def open_character(path: Path | None, output: Path | None) -> Skeleton | None:
    """Skeleton of the character who is to move, if one is named.

    Raises
    ------
    InputError
        No motion is written.
    FileError, SkeletonError
        As of ``load_skeleton``; or its legs are those of no character, as a file in centimetres has them.
    """
    from stridecast.errors import FileError, InputError, SkeletonError
    from stridecast.formats.recordings import load_skeleton

    if path is None:
        return None
    if output is None or output.suffix.lower() in (".csv", ".parquet"):
        raise InputError("--skeleton goes with an output that has bodies, such as *.bvh")
    if path.absolute() == output.absolute():
        raise FileError("would be overwritten by the result; name another output", path=path)
    skeleton = load_skeleton(path)
    if not LEGS[0] <= skeleton.leg_length <= LEGS[1]:
        raise SkeletonError(
            f"{path}: its legs are {skeleton.leg_length:.3g} m long, and {LEGS[0]:g} to {LEGS[1]:g} m can walk; "
            "was it exported in another unit than metres?"
        )
    return skeleton


def played(
    motion: Motion, character: Skeleton | None, planted: Bool[np.ndarray, "frames 2"], *, size: float = 1.0
) -> Motion:
    """The motion, on the character in a size if there is one."""
    from stridecast.body.character import resized
    from stridecast.body.recasting import recast

    return motion if character is None else recast(motion, resized(character, size), planted)


def height_of(character: Skeleton, model: Skeleton) -> float:
    """Height of a character that stands as the model does, metres."""
    from stridecast.body.alignment import aligned, alignment
    from stridecast.body.character import stature

    return stature(aligned(character, alignment(character, model)))

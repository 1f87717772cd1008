"""``stridecast live`` and ``stridecast demo``: the page in the browser, steered by hand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stridecast.cli.databases import Database, open_database

if TYPE_CHECKING:
    from stridecast.live.serve import LiveServer

Scene = Annotated[
    Path | None,
    typer.Option(metavar="SCENE.yaml", help="The scene that scene mode begins with.", show_default=False),
]
Host = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Listen there instead of on this machine only, as 0.0.0.0; others then need the token that is printed.",
        show_default=False,
    ),
]
Port = Annotated[
    int | None,
    typer.Option(
        min=0, max=65535, metavar="N", help="Port; 8047, or any that is free, if left out.", show_default=False
    ),
]
Vmc = Annotated[
    str | None,
    typer.Option(
        metavar="HOST:PORT",
        help="Play who is on the page to a receiver of the VMC protocol too; more clients have the next ports.",
        show_default=False,
    ),
]
VmcPeople = Annotated[
    int,
    typer.Option(
        min=1,
        max=16,
        metavar="N",
        help="In scene mode play so many people to receivers, those who came first, each to a port of their own.",
    ),
]
Skeleton = Annotated[
    Path | None,
    typer.Option(
        "--skeleton",
        metavar="CHARACTER.glb|.bvh",
        help="Everybody is this character, with its proportions and, from a rigged GLB, its meshes.",
        show_default=False,
    ),
]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but the address.")]


def live(
    database: Database = None,
    scene: Scene = None,
    host: Host = None,
    port: Port = None,
    vmc: Vmc = None,
    vmc_people: VmcPeople = 1,
    skeleton: Skeleton = None,
    browser: Browser = True,
    quiet: Quiet = False,
) -> None:
    """Open the page: steer a walker by hand, draw scenes and watch crowds in them, look through the database."""
    _serve(database, scene, host, port, vmc, vmc_people, skeleton, browser, quiet)


def demo(
    scene: Scene = None,
    host: Host = None,
    port: Port = None,
    vmc: Vmc = None,
    vmc_people: VmcPeople = 1,
    skeleton: Skeleton = None,
    browser: Browser = True,
    quiet: Quiet = False,
) -> None:
    """Open the page with the sample database, which needs no recordings."""
    _serve(None, scene, host, port, vmc, vmc_people, skeleton, browser, quiet)


def _serve(
    database: Path | None,
    scene: Path | None,
    host: str | None,
    port: int | None,
    vmc: str | None,
    vmc_people: int,
    skeleton: Path | None,
    browser: bool,
    quiet: bool,
) -> None:
    from stridecast.cli import screen
    from stridecast.formats.recordings import load_skeleton
    from stridecast.formats.vmc import parsed_address
    from stridecast.live.cast import cast
    from stridecast.live.serve import LiveServer

    receiver = None if vmc is None else parsed_address(vmc)
    place = None if scene is None else _scene(scene)
    character = None if skeleton is None else load_skeleton(skeleton)
    learned = open_database(database, quiet=quiet)
    costume = None
    if skeleton is not None and character is not None:
        with screen.progress(quiet, {"cast": "playing all segments by the character"}) as progress:
            learned, costume = cast(learned, skeleton, character, lambda done, total: progress("cast", done, total))
    name = "sample database" if database is None else database.stem
    server = LiveServer(
        learned, name, costume=costume, scene=place, host=host, port=port, receiver=receiver, received=vmc_people
    )
    with screen.progress(quiet, {}):
        try:
            server.run(ready=lambda: _tell(server, browser=browser, quiet=quiet))
        except KeyboardInterrupt:
            if not quiet:
                screen.tell_note("stopped")


def _scene(path: Path) -> dict[str, Any]:
    from stridecast.formats.scenes import load_scene, scene_values

    return scene_values(load_scene(path))


def _tell(server: LiveServer, *, browser: bool, quiet: bool) -> None:
    """Say where the page is, and open it."""
    import webbrowser

    from stridecast.cli import screen

    screen.out.print(server.address, markup=False, soft_wrap=True)
    if not quiet:
        screen.tell_note("the page is at this address for as long as this runs; Ctrl-C ends it")
        if server.token is not None:
            screen.tell_note("others reach it too, by this machine's name and with the token in the address")
    if browser:
        webbrowser.open(server.address)

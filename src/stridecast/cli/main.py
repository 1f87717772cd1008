"""The command ``stridecast``. What a command needs is imported when it runs, so that help comes at once."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from stridecast.cli import build, crowd, dress, fetch, live, mine, samples, score, show, walk
from stridecast.errors import InputError


class _Commands(TyperGroup):
    """Tells what is wrong with an input in one line, and ends with status 2."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except InputError as error:
            from stridecast.cli.screen import tell_error

            tell_error(str(error))
            raise typer.Exit(2) from None


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("demo")(live.demo)
app.command("live")(live.live)
app.command("build")(build.build)
app.command("show")(show.show)
app.command("mine")(mine.mine)
app.command("walk")(walk.walk)
app.command("crowd")(crowd.crowd)
app.command("dress")(dress.dress)
app.command("samples")(samples.samples)
app.command("fetch")(fetch.fetch)
app.command("score")(score.score)


def _version(wanted: bool) -> bool:
    if wanted:
        from stridecast import __version__

        typer.echo(f"stridecast {__version__}")
        raise typer.Exit
    return wanted


@app.callback()
def stridecast(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and leave.")
    ] = False,
) -> None:
    """Learn from motion capture how people steer, and let any character walk and run like that."""


def main() -> None:
    """Run the command."""
    app()

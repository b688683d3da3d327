"""What several commands take, and how they answer."""

from pathlib import Path
from typing import Annotated, Any

import typer

from suffice.door import write_json

RunFile = Annotated[Path, typer.Argument(metavar="RUN", help="a run.h5 made by simulate or import")]
Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE|-", help="write the answer as JSON; - is standard output")
]
Variables = Annotated[
    list[str] | None, typer.Option("--variable", help="such as position.x or velocity; may be repeated")
]


def tell(answer: Any, target: str | None) -> bool:
    """Write the answer as JSON where asked, and return whether there is still a terminal to show it on."""
    if target is not None:
        write_json(answer, target)
    return target != "-"

"""`python -m recognition.study`: the experiments of recognition."""

from __future__ import annotations

from functools import partial

from recognition.study.agreement.command import agreement
from recognition.study.places import places
from recognition.study.protocol.command import protocol
from recognition.study.sites import sites
from recognition.study.smoothing.command import smoothing
from schemas.commands.options import Version, guarded, new_app

NAME = "python -m recognition.study"

app = new_app(NAME)


@app.callback()
def recognition_study(_version: Version = False) -> None:
    """Evaluate TRFE and its baselines, and survey labels; each command has --help."""


app.command("protocol")(protocol)
app.command("agreement")(agreement)
app.command("sites")(sites)
app.command("places")(places)
app.command("smoothing")(smoothing)


def main() -> None:
    """Entry point."""
    guarded("recognition.study", partial(app, prog_name=NAME))


if __name__ == "__main__":
    main()

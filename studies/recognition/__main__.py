"""`python -m studies.recognition`: the experiments of recognition."""

from __future__ import annotations

from functools import partial

from schemas.common.terminal.command_line import Version, guarded, new_app
from studies.recognition.agreement.command import agreement
from studies.recognition.places import places
from studies.recognition.protocol.command import protocol
from studies.recognition.sites import sites
from studies.recognition.smoothing.command import smoothing

NAME = "python -m studies.recognition"

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
    guarded("studies.recognition", partial(app, prog_name=NAME))


if __name__ == "__main__":
    main()

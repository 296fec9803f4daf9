"""Panels of text in recordings: what is shown, and which colour is what."""

from collections.abc import Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import COLOUR_NAMES
from structlearn.readers.demonstration import Demonstration
from structlearn.viewer.rrd import entity


def send_notes(stream: rr.RecordingStream, text: str, *parts: str) -> None:
    """Log what is shown, in Markdown."""
    stream.log(notes_path(*parts), rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


def notes_view(*parts: str, name: str = "what is shown") -> rrb.TextDocumentView:
    """Panel of what `send_notes` logs."""
    path = notes_path(*parts)
    return rrb.TextDocumentView(name=name, origin=path, contents=[path])


def notes_path(*parts: str) -> str:
    """Entity of notes."""
    return entity("notes", *parts)


def colour_words(colours: dict[str, str]) -> str:
    """A legend in Markdown of what has which colour, by name of the colour."""
    return "\n".join(f"- {colour}: {meaning}" for colour, meaning in colours.items())


def legend(colours: Mapping[str, str]) -> str:
    """A legend in Markdown of names with their colours of the palette."""
    return "\n".join(f"- {COLOUR_NAMES[colour]}: {name}" for name, colour in colours.items())


def origin_sentence(runs: Sequence[Demonstration], subject: str = "Everything here is") -> str:
    """Whether runs are simulated or recorded, for a panel's text."""
    simulated = sum(run.simulated for run in runs)
    if simulated in (0, len(runs)):
        return f"{subject} {'simulated' if simulated else 'recorded'}."
    return f"{simulated} of {len(runs)} runs are simulated, the others recorded."

"""How much is taken of a client."""

from __future__ import annotations

from stridecast.formats.recordings import RECORDINGS
from stridecast.live.messages import LARGEST_MESSAGE, LimitsPart

MESSAGES = 240
"""Messages a second that are read, ..."""

BURST = 480
"""... so many at once."""

FLOOD = 2000
"""Who sends more a second is let go."""

PATIENCE = 50
"""So many messages that are none, one after the other, and the client is let go."""

MOST_LIVE = 4000
"""So many people are in a live scene at most."""

FASTEST_FLOW = 50.0
"""So many come a second at most, by all sources together."""


def usual_limits() -> LimitsPart:
    """Limits of a server on one's own machine."""
    return LimitsPart(
        message_bytes=LARGEST_MESSAGE,
        messages_per_second=MESSAGES,
        file_bytes=64 * 2**20,
        files=200,
        files_bytes=512 * 2**20,
        file_kinds=[*RECORDINGS, ".asf"],
        timeline_bytes=256 * 2**20,
    )

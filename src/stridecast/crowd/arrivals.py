"""Who is due when: people by name and what sources send, of which each can change while time runs."""

from __future__ import annotations

from collections.abc import Iterator

from stridecast.crowd.population import Due, Population


class Arrivals:
    """Takes those who are due out of a population, and keeps those for whom there is no room yet.

    Parameters
    ----------
    population
        Everybody who ever comes.
    """

    def __init__(self, population: Population) -> None:
        self._named = population.named()
        self._streams: dict[str, Iterator[Due]] = {}
        self._next: dict[str, Due] = {}
        self._held_back: list[tuple[Due, int]] = []
        self._sent: dict[str, int] = {}
        for source in population.sources:
            self._open(source, population.stream(source))

    @property
    def waiting(self) -> int:
        """People who are due but have no room yet."""
        return sum(len(due.people) for due, _ in self._held_back)

    @property
    def over(self) -> bool:
        """Whether nobody comes any more."""
        return not (self._named or self._next or self._held_back)

    @property
    def names(self) -> set[str]:
        """People by name who have yet to come."""
        waiting = [due for due, _ in self._held_back if due.source is None]
        return {person.name for due in (*self._named, *waiting) for person in due.people}

    def sent(self, source: str) -> int:
        """So many have been due from a source."""
        return self._sent.get(source, 0)

    def due(self, frame: int) -> list[tuple[Due, int]]:
        """Who is due by a frame, in the order of time, and how often they have been held back; take them out."""
        held, self._held_back = self._held_back, []
        new = [due for due in self._named if due.frame <= frame]
        self._named = self._named[len(new) :]
        for source in list(self._next):
            while source in self._next and self._next[source].frame <= frame:
                due = self._next[source]
                new.append(due)
                self._sent[source] = self.sent(source) + len(due.people)
                self._advance(source)
        return held + [(due, 0) for due in sorted(new, key=lambda due: due.time)]

    def hold_back(self, due: Due, attempt: int) -> None:
        """Let somebody wait who is due."""
        self._held_back.append((due, attempt))

    def take_out(self, people: set[str], sources: set[str]) -> None:
        """Forget people by name who have yet to come, and what sources would send."""
        self._named = [due for due in self._named if due.people[0].name not in people]
        self._held_back = [
            (due, attempt)
            for due, attempt in self._held_back
            if (due.source not in sources if due.source else due.people[0].name not in people)
        ]
        for source in sources:
            self._streams.pop(source, None)
            self._next.pop(source, None)

    def put_in(self, people: list[Due], streams: dict[str, Iterator[Due]]) -> None:
        """Let more come: people by name, and what sources send, by their names."""
        self._named = sorted((*self._named, *people), key=lambda due: due.time)
        for source, stream in streams.items():
            self._open(source, stream)

    def _open(self, source: str, stream: Iterator[Due]) -> None:
        self._streams[source] = stream
        self._advance(source)

    def _advance(self, source: str) -> None:
        due = next(self._streams[source], None)
        if due is None:
            self._next.pop(source, None)
        else:
            self._next[source] = due

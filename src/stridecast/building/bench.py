"""Where takes are worked on: results are remembered or worked out, by many processes, and progress is told."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from stridecast.building.cache import Entry, TakeCache
from stridecast.building.entries import pack_failure, unpack_failure
from stridecast.building.processes import Failure, Workers
from stridecast.errors import InputError

Task = TypeVar("Task")
Result = TypeVar("Result")

Progress = Callable[[str, int, int], None]
"""Called with a stage, how much of it is done, and how much there is."""

log = logging.getLogger("stridecast")


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """What the stages of a build work with."""

    workers: Workers
    cache: TakeCache
    progress: Progress | None

    def tell(self, stage: str, done: int, total: int) -> None:
        """Tell how far a stage is, if there is anything to do in it."""
        if self.progress is not None and total:
            self.progress(stage, done, total)

    def do(
        self,
        stage: str,
        function: Callable[[Task], Result],
        tasks: Sequence[Task],
        keys: Sequence[str],
        pack: Callable[[Result], Entry],
        unpack: Callable[[Entry], Result],
    ) -> list[Result | Failure]:
        """Work on tasks.

        Parameters
        ----------
        stage
            What progress is told under.
        function, tasks
            As of ``Workers.spread``.
        keys
            Under which the results are remembered.
        pack, unpack
            From a result to an entry of the cache, and back.

        Returns
        -------
        The results, in the order of the tasks.
        """
        done = {number: result for number, key in enumerate(keys) if (result := self._remembered(key, unpack))}
        self.tell(stage, len(done), len(tasks))
        rest = [number for number in range(len(tasks)) if number not in done]
        for place, result in self.workers.spread(function, [tasks[number] for number in rest]):
            number = rest[place]
            done[number] = result
            if not isinstance(result, Failure):
                self.cache.put(keys[number], *pack(result))
            elif result.lasting:
                self.cache.put(keys[number], *pack_failure(result))
            self.tell(stage, len(done), len(tasks))
        return [done[number] for number in range(len(tasks))]

    def _remembered(self, key: str, unpack: Callable[[Entry], Result]) -> Result | Failure | None:
        entry = self.cache.get(key)
        if entry is None:
            return None
        try:
            return unpack_failure(entry) or unpack(entry)
        except (InputError, KeyError, TypeError, ValueError) as error:
            log.info("a remembered take is damaged and is worked out again: %r", error)
            return None

"""Work of one request done by several threads: every item has work of its own, so that answers don't depend
on how many there are or which one is first.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from ir_planner.request import Context, Journal, Work

Item = TypeVar("Item")
Result = TypeVar("Result")


def mapped(
    task: Callable[[Item, Context], Result],
    items: Sequence[Item],
    context: Context,
    improvement: int,
    threads: int = 0,
) -> list[Result]:
    """task(item, context of its own) for every item, in order; what each did is added to `context`'s journal.

    improvement: work of each for better answers. threads: 0: as many as there are cores.
    Raises what the first failing task raises, CancelledError when asked to stop.
    """
    own = [_own(context, improvement) for _ in items]
    count = min(threads or len(os.sched_getaffinity(0)), len(items))
    if count <= 1:
        results = [task(item, mine) for item, mine in zip(items, own, strict=True)]
    else:
        with ThreadPoolExecutor(count) as pool:
            results = list(pool.map(task, items, own))
    for mine in own:
        context.work.iterations += mine.work.iterations
        context.work.truncated |= mine.work.truncated
        context.journal.rejected.update(mine.journal.rejected)
    context.work.check()
    return results


def _own(context: Context, improvement: int) -> Context:
    """The context with work and a journal of its own, from what the request has left."""
    work = context.work
    left = max(work.max_iterations - work.iterations, 0)
    mine = Work(left, work.deadline, work.clock, work.cancelled, improvement)
    return Context(context.scene, context.options, Journal(mine, context.journal.seed), context.station)

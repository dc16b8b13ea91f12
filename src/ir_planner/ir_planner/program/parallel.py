"""Work of one request done by several threads: every item has work of its own, so that answers
don't depend on how many there are or which one is first.
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
    most: Sequence[int],
    threads: int = 0,
) -> list[Result]:
    """task(item, context of its own) for every item, in order; what each did is added to
    `context`'s journal.

    improvement: work of each for better answers; most: of each at all. threads: 0: those of the
    context's work. Raises what the first failing task raises, CancelledError when asked to stop.
    """
    own = [_own(context, improvement, left) for left in most]
    count = min(threads or context.work.threads or len(os.sched_getaffinity(0)), len(items))
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


def _own(context: Context, improvement: int, left: int) -> Context:
    """The context with so much work and a journal of its own."""
    work = context.work
    mine = Work(left, work.deadline, work.clock, work.cancelled, improvement, work.threads)
    return Context(
        context.scene, context.options, Journal(mine, context.journal.seed), context.station
    )

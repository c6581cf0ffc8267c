"""``make mutants``: tries every break of safety code and says which the tests found; they must find all.

    python tests/mutants/run.py [WORD ...] [--jobs N] [--list]

WORD: only breaks whose name or file contains one of these words. The tests that are to find them run on the unbroken code
first: they must be green there. Exit code 1 unless every break applies and is found.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue
from typing import TypeVar

from breaks import BREAKS
from mutant import INVALID, KILLED, Break, Result, copied_tree, run_tests, try_break

_Item = TypeVar("_Item")
_Outcome = TypeVar("_Outcome")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", metavar="WORD")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time (2)")
    parser.add_argument("--list", action="store_true", help="only name them, and whether they apply")
    arguments = parser.parse_args()
    chosen = [one for one in BREAKS if not arguments.words or any(word in f"{one.path} {one.name}" for word in arguments.words)]
    if arguments.list:
        return _list(chosen)
    begun = time.perf_counter()
    with ExitStack() as stack:
        trees: SimpleQueue[Path] = SimpleQueue()
        for _ in range(max(1, arguments.jobs)):
            trees.put(stack.enter_context(copied_tree()))
        red = _each(sorted({one.tests for one in chosen}), run_tests, trees, lambda tests, came: _sound(tests, *came))
        results = _each(chosen, try_break, trees, _row)
    unsound = sum(code != 0 for code, _ in red)
    return _summary(results, unsound, time.perf_counter() - begun)


def _each(
    items: list[_Item],
    what: Callable[[_Item, Path], _Outcome],
    trees: SimpleQueue[Path],
    told: Callable[[_Item, _Outcome], None],
) -> list[_Outcome]:
    """``what`` of each item, as many at a time as there are trees; ``told`` of each as it comes."""

    def one(item: _Item) -> _Outcome:
        tree = trees.get()
        try:
            outcome = what(item, tree)
        finally:
            trees.put(tree)
        told(item, outcome)
        return outcome

    with ThreadPoolExecutor(trees.qsize()) as pool:
        return list(pool.map(one, items))


def _sound(tests: str, code: int, seen: str) -> None:
    if code:
        print(f"not green on the unbroken code: pytest {tests}\n    {seen}", flush=True)


def _row(one: Break, result: Result) -> None:
    print(f"{result.outcome:8}  {result.seconds:5.1f} s  {one.name}", flush=True)
    if result.outcome != KILLED:
        print(f"    in {one.path}; {one.harm}\n    {result.seen or 'no test failed'}: pytest {one.tests}", flush=True)


def _summary(results: list[Result], unsound: int, seconds: float) -> int:
    counts = Counter(result.outcome for result in results)
    survived = len(results) - counts[KILLED] - counts[INVALID]
    print(
        f"\n{len(results)} breaks: {counts[KILLED]} killed, {survived} survived, {counts[INVALID]} could not be tried, ", end=""
    )
    print(f"in {seconds:.0f} s; {unsound} selections of tests were not green on the unbroken code")
    return 0 if results and counts[KILLED] == len(results) and not unsound else 1


def _list(chosen: list[Break]) -> int:
    wrong = 0
    for one in chosen:
        try:
            one.broken()
            print(f"{one.path}: {one.name}")
        except LookupError as error:
            wrong += 1
            print(f"{one.path}: {one.name}: DOES NOT APPLY: {error}")
    print(f"{len(chosen)} breaks, {wrong} of them do not apply")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

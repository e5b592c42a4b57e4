"""A campaign in parts: which draws are a shard's, and shards put together again."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, replacing
from baryscope.study.campaign.folder import HEADER, RUNS, read_plan, write_plan
from baryscope.study.campaign.plan import Plan


@dataclass(frozen=True)
class Shard:
    """Every `of`-th draw of each scenario, from the `index`-th on, counted from 1."""

    index: int = 1
    of: int = 1

    def __str__(self) -> str:
        return f"{self.index}/{self.of}"

    def numbers(self, draws: int, ended: NDArray[np.bool_]) -> list[int]:
        """The draws that are this shard's and have not ended."""
        mine = np.arange(self.index - 1, draws, self.of)
        left: list[int] = mine[~ended[mine]].tolist()
        return left


ALL = Shard()


def shard_of(text: str) -> Shard:
    """The shard of a text such as 3/8.

    Raises:
        InputError: it is none.
    """
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text.strip())
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise InputError(f"shard: found {text!r}, expected K/N with K from 1 to N, such as 3/8")
    return Shard(int(found[1]), int(found[2]))


def merge(folders: Sequence[AnyPath], output: AnyPath) -> Plan:
    """Put the runs of several folders, shards of one plan, into a new folder.

    A run that several folders have is taken once.

    Returns:
        The plan, with the highest number of draws of all.

    Raises:
        InputError: fewer than two folders; one is named twice; their plans differ; two runs of a draw differ; or the
            output is there.
    """
    from baryscope.study.campaign.reading import Ended, blocks_of  # slow to load, and workers do without

    sources, output = [Path(folder) for folder in folders], Path(output)
    if len(sources) < 2:
        raise InputError(f"merge: found {len(sources)} folder, expected at least two")
    places = [folder.resolve() for folder in sources]
    twice = next((folder for k, folder in enumerate(sources) if places[k] in places[:k]), None)
    if twice is not None:
        raise InputError(f"merge: found {twice} twice, expected each folder once")
    taken = next((name for name in (HEADER, RUNS) if (output / name).exists()), None)
    if taken is not None or (output.exists() and not output.is_dir()):
        raise InputError(f"{output / taken if taken else output}: is there already, expected a new folder")
    plans = [read_plan(folder) for folder in sources]
    for folder, plan in zip(sources[1:], plans[1:], strict=True):
        difference = plans[0].difference(plan)
        if difference is not None:
            raise InputError(
                f"{folder}: holds a campaign with {difference} as in {sources[0]}; expected shards of one plan"
            )
    merged = replace(plans[0], draws=max(plan.draws for plan in plans))
    ended = Ended(merged)
    with replacing(output / RUNS) as temporary, temporary.open("wb") as stream:
        for folder, plan in zip(sources, plans, strict=True):
            for block in blocks_of(folder, replace(plan, draws=merged.draws), ended):
                lines = zip(block.lines.splitlines(keepends=True), block.fresh, strict=True)
                stream.writelines(line for line, fresh in lines if fresh)
        write_plan(merged, output / HEADER)
    return merged

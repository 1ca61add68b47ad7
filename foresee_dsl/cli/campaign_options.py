"""The options that the commands about campaigns share, and what is made of them."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from foresee_dsl.campaign.engine import RunOptions
    from foresee_dsl.campaign.executors import Executor
    from foresee_dsl.campaign.settings import CampaignSettings, Shard

CPUS = os.cpu_count() or 1
Jobs = Annotated[int, typer.Option("--jobs", min=1, max=256, help="Worker processes.")]
Paths = Annotated[
    list[str], typer.Argument(metavar="PATH", help="Scenario files, folders, or test cases (FILE::CASE).")
]
Before = Annotated[float, typer.Option(min=0.5, max=60, help="Seconds of a clip before its risky point.")]
After = Annotated[float, typer.Option(min=0.5, max=60, help="Seconds of a clip after it.")]
RiskyPoints = Annotated[int, typer.Option(min=1, max=1000, help="Risky points of a run, at most.")]
Children = Annotated[int, typer.Option(min=0, max=1000, help="Mutated children of a clip.")]
Repeat = Annotated[int, typer.Option(min=1, max=10_000, help="Mutate the clips so often, each time with another seed.")]
StoreOption = Annotated[
    Path | None, typer.Option("--store", help="Where results are kept and looked up; OUT/store unless you say.")
]
ShardOption = Annotated[str, typer.Option("--shard", metavar="K/N", help="Only part K of N, for job arrays.")]


def settings_of(
    driver: str, ranker: str, preset: str, *, before: float, after: float, risky_points: int, children: int,
    handover: float, seed: int, repeat: int,
) -> CampaignSettings:  # fmt: skip
    """Return the settings, checked: unknown names are said before anything runs."""
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.derive.clip import DRIVES_S
    from foresee_dsl.derive.presets import preset as load_preset
    from foresee_dsl.drivers.registry import load_driver
    from foresee_dsl.forecast.registry import load_ranker

    if handover > max(before - DRIVES_S, 0.0):
        message = f"it has to end {DRIVES_S:g} s before the risky point, so {before - DRIVES_S:g} s is the longest here"
        raise typer.BadParameter(message, param_hint="--handover")
    load_driver(driver)
    load_ranker(ranker)
    load_preset(preset)
    return CampaignSettings(
        driver, ranker, preset, before, after, risky_points, children, seed, handover_s=handover, repeat=repeat
    )


def shard_of(text: str) -> Shard:
    """Return which part of a campaign `--shard` means; all of it for ""."""
    from foresee_dsl.campaign.settings import Shard

    try:
        return Shard.parse(text) if text else Shard()
    except ValueError as err:
        raise typer.BadParameter(str(err), param_hint="--shard") from err


def executor_of(name: str, scheduler: str) -> Callable[[RunOptions], Executor]:
    """Return what makes the executor that `--executor` and `--scheduler` mean."""
    from foresee_dsl.campaign.executors import local

    if name == "dask":
        from foresee_dsl.campaign.cluster import dask

        return dask(scheduler)
    if name != "local":
        raise typer.BadParameter(f"{name!r} is none: local, dask", param_hint="--executor")
    if scheduler:
        raise typer.BadParameter("it needs --executor dask", param_hint="--scheduler")
    return local

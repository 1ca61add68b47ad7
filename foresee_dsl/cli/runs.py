"""Commands for single runs and for files that derive from them: `run`, `forecast`, `clip` and `mutate`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foresee_dsl.cli.completion import case_addresses
from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.common import FailFastOption, FirstOption, OnlyOption, profiling, selected
from foresee_dsl.cli.options.output import FormatOption, JunitOption, report_results
from foresee_dsl.language.campaign_values import (
    AROUND_S,
    CHILDREN_BOUNDS,
    DEFAULT_AROUND_S,
    DEFAULT_CHILDREN,
    RULES_MODE,
)
from foresee_dsl.measuring import Part
from foresee_dsl.report.formats import CommandReport

if TYPE_CHECKING:
    from rich.console import Console

    from foresee_dsl.campaign.execution.runs import CaseRun
    from foresee_dsl.campaign.records import ChildOutcome
    from foresee_dsl.compile.bundle import SumoBundle
    from foresee_dsl.forecast.protocol import RiskyPoint
    from foresee_dsl.simulate.trace import Trace

TraceArgument = Annotated[Path, typer.Argument(metavar="TRACE", help="A trace (.npz) that `foresee run` wrote.")]
Before = Annotated[float, typer.Option(min=AROUND_S[0], max=AROUND_S[1], help="Seconds before the risky point.")]
After = Annotated[float, typer.Option(min=AROUND_S[0], max=AROUND_S[1], help="Seconds after the risky point.")]


def run(
    ctx: typer.Context,
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE[::CASE]",
            help="A scenario (all its cases), a single test case, a clip or a mutant.",
            autocompletion=case_addresses,
        ),
    ],
    driver: common.DriverOption = "pdm",
    seed: common.SeedOption = 0,
    rules: common.RulesOption = RULES_MODE,
    out: Annotated[Path | None, typer.Option("--out", help="Save the traces in this folder.")] = None,
    jobs: Annotated[int, common.jobs_option("Number of processes among which several cases are divided.")] = 1,
    first: FirstOption = None,
    only: OnlyOption = None,
    fail_fast: FailFastOption = False,
    step_deadline: common.StepDeadlineOption = None,
    deadline: common.DeadlineOption = None,
    debug: Annotated[
        bool,
        typer.Option(
            "--debug",
            help="Run in this process: breakpoint() works, there are no deadlines, and prints are not captured.",
        ),
    ] = False,
    format_: FormatOption = "text",
    junit: JunitOption = None,
    strict: Annotated[
        bool, typer.Option("--strict", hidden=True, help="No effect: a broken expectation is always a failure.")
    ] = False,
    exit_zero: common.ExitZeroOption = False,
    allow_outside: common.AllowOutsideOption = False,
    profile: common.ProfileOption = False,
) -> None:
    """Run a test case, or all cases of a file, with a driver, and print how each run ended.

    Exit code 1 when a run did not pass, or broke an `expect` line or a traffic rule; the driver's own prints appear
    with its run.

    [dim]foresee run scenarios/scenario7.foresee::r01 --out runs
    foresee run scenarios/scenario7.foresee --fail-fast[/dim]
    """
    del strict  # existing scripts may still pass it
    profiler = ctx.with_resource(profiling()) if profile else None
    from foresee_dsl.campaign.driving import DriverSetup
    from foresee_dsl.campaign.execution.runs import run_cases, run_here
    from foresee_dsl.compile import placement_mistakes
    from foresee_dsl.drivers.deadlines import Deadlines
    from foresee_dsl.drivers.registry import find_driver
    from foresee_dsl.errors import InputError
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_dsl.report.builds.case_results import of_case_run
    from foresee_dsl.report.terminal.runs import print_case_run, print_case_runs

    find_driver(driver)  # an unknown name is reported before anything runs
    with Part.READING:
        cases = selected(load_test_cases(paths, allow_outside=allow_outside), first, only)
        if mistakes := placement_mistakes(cases):
            raise InputError(mistakes)
    setup = DriverSetup(driver, seed, Deadlines(step_deadline, deadline), rules)
    if profiler is not None:
        profiler.ready()
    runs = (run_here(case, setup) for case in cases) if debug else run_cases(cases, setup, jobs=jobs, profiler=profiler)
    done = []
    for case_run in runs:
        done.append(case_run)
        if fail_fast and not case_run.passed:
            break
    order = {case.id: k for k, case in enumerate(cases)}
    done.sort(key=lambda case_run: order[case_run.case.id])
    single = len(paths) == len(cases) == 1
    traces = _saved(done, out)
    case_results = [of_case_run(case_run, driver, seed, traces.get(case_run.case.id)) for case_run in done]
    time_profile = (
        profiler.profile([driver], workers=1 if debug else min(jobs, len(cases))) if profiler is not None else None
    )

    def people(screen: Console) -> None:
        if single:
            print_case_run(screen, done[0], traces.get(done[0].case.id))
        else:
            print_case_runs(screen, done, len(cases), traces)
        if time_profile is not None:
            from foresee_dsl.report.terminal.profile import print_profile

            print_profile(screen, time_profile)

    def data() -> str:
        every = _documents(done, driver, seed, traces)
        more = {"profile": time_profile} if time_profile is not None else {}
        return (
            common.json_document({**every[0], **more})
            if single
            else common.json_document({"runs": every, **more}, "runs")
        )

    report_results(
        format_,
        CommandReport("run", data, lambda: case_results, properties=(("driver", driver), ("seed", str(seed)))),
        people=people,
        junit=junit,
    )
    if not exit_zero and not all(case_run.passed for case_run in done):
        raise typer.Exit(common.FAILED)


def _saved(runs: Sequence[CaseRun], out: Path | None) -> dict[str, Path]:
    """Write the traces if there is a folder; return the file of each saved trace by its test case."""
    from foresee_dsl.campaign.driving import case_name

    files = {}
    for case_run in runs if out is not None else ():
        if out is not None and case_run.result is not None:
            out.mkdir(parents=True, exist_ok=True)
            files[case_run.case.id] = out / f"{case_name(case_run.case)}.npz"
            case_run.result.trace.save(files[case_run.case.id])
    return files


def _documents(runs: Sequence[CaseRun], driver: str, seed: int, traces: Mapping[str, Path]) -> list[dict[str, Any]]:
    return [
        {
            "test_case": case_run.case.id,
            "driver": driver,
            "seed": seed,
            **_run_dict(case_run, traces.get(case_run.case.id)),
        }
        for case_run in runs
    ]


def _run_dict(case_run: CaseRun, trace: Path | None) -> dict[str, object]:
    """Return a run for JSON; if its process died, only the verdict and the driver's prints are real."""
    from foresee_dsl.simulate.results.near_misses import NearMisses

    result = case_run.result
    return {
        "verdict": case_run.verdict,
        "time_s": round(result.time_s, 2) if result else 0.0,
        "with": result.with_ if result else "",
        "reason": case_run.reason,
        "impact": result.impact if result else None,
        "near_misses": result.near_misses if result else NearMisses(None, None, None, None),
        "duration_s": round(result.duration_s, 2) if result else 0.0,
        "steps": result.steps if result else 0,
        "expectations": result.expectations if result else (),
        "infractions": result.infractions if result else (),
        "unfired": result.unfired if result else (),
        "tracking": result.tracking if result else None,
        **case_run.notes.as_document(),
        "trace": trace,
        "digest": result.trace.digest if result else "",
    }


def forecast(
    trace: TraceArgument,
    ranker: common.RankerOption = "foresee",
    seed: common.SeedOption = 0,
    before: Before = DEFAULT_AROUND_S,
    after: After = DEFAULT_AROUND_S,
    json: common.JsonOption = False,
    allow_outside: common.AllowOutsideOption = False,
) -> None:
    """Rank the moments of a run around which a failure may hide.

    [dim]foresee forecast runs/red_light_runner_r01.npz --ranker proximity[/dim]
    """
    points = _points(_load_trace(trace), ranker, seed, before, after, allow_outside=allow_outside)
    if json:
        common.print_json({"trace": trace, "ranker": ranker, "risky_points": points})
        return
    from foresee_dsl.report.terminal.tables import print_points

    print_points(common.console(), points)


def clip(
    trace: TraceArgument,
    ranker: common.RankerOption = "foresee",
    rank: Annotated[int, typer.Option(min=1, help="Rank of the risky point to clip; 1 is the riskiest.")] = 1,
    seed: common.SeedOption = 0,
    before: Before = DEFAULT_AROUND_S,
    after: After = DEFAULT_AROUND_S,
    handover: common.HandoverOption = None,
    out: common.OutOption = Path("clips"),
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the program that the trace records as an external driver.")
    ] = False,
    json: common.JsonOption = False,
    allow_outside: common.AllowOutsideOption = False,
) -> None:
    """Cut the seconds around a risky point out of a run and write them as a clip file.

    The clip is run once without mutation: its `fidelity` line states how far it deviates from its parent run.

    [dim]foresee clip runs/red_light_runner_r01.npz --rank 2 --out clips[/dim]
    """
    from foresee_dsl.campaign.driving import DriverSetup, case_name
    from foresee_dsl.campaign.records import why_untrusted
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.clip import measure_clip
    from foresee_dsl.campaign.steps.forecast import clip_around
    from foresee_dsl.derive.clipping.clip import DRIVES_S
    from foresee_dsl.drivers.consent import refuse_programs
    from foresee_dsl.drivers.registry import handover_of, load_driver
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.files import write_whole
    from foresee_dsl.language.printer import print_model
    from foresee_dsl.language.project.loading import load_test_case

    loaded = _load_trace(trace)
    points = _points(loaded, ranker, seed, before, after, allow_outside=allow_outside)
    if rank > len(points):
        raise ForeseeError(
            f"{trace} has {len(points)} risky points by {ranker}, so there is no risky point of rank {rank}"
        )
    point = points[rank - 1]
    case = load_test_case(str(loaded.meta["test_case"]), allow_outside=allow_outside)
    file = out / f"{case_name(case)}_p{rank}.foresee"
    driver, run_seed = str(loaded.meta["driver"]), int(loaded.meta["seed"])
    refuse_programs([(driver, trace)], "--run-programs starts it", unless=run_programs)
    if handover is None:
        handover = handover_of(load_driver(driver), before - DRIVES_S)
    try:
        model = clip_around(case, loaded, point, file, before_s=before, after_s=after, handover_s=handover)
    except ValueError as err:
        raise ForeseeError(str(err)) from err
    model, _, result, fidelity_of_clip = measure_clip(model, case, loaded, file, DriverSetup(driver, run_seed))
    write_whole(file, print_model(model))
    if json:
        from foresee_dsl.documents import plain

        fidelity = {
            "fidelity_m": round(fidelity_of_clip.largest_others_m, 4),
            "fidelity_ego_m": round(fidelity_of_clip.ego_m, 4),
        }
        common.print_json({"clip": file, **fidelity, **plain(point)})
    else:
        strays = f"fidelity {fidelity_of_clip.largest_others_m:.2f} m, of the ego {fidelity_of_clip.ego_m:.2f} m"
        typer.echo(f"{file}\n  {point.why}\n  {strays}")
        limit_m = CampaignSettings.fidelity_limit_m
        if why := why_untrusted(result.verdict, fidelity_of_clip.largest_m, limit_m):
            typer.echo(f"  a campaign does not use this clip: {why}")


def mutate(
    file: Annotated[Path, typer.Argument(metavar="CLIP", help="A clip's file.")],
    preset: common.PresetOption = "focused",
    children: Annotated[int, typer.Option(min=1, max=CHILDREN_BOUNDS[1], help="Number of mutants.")] = DEFAULT_CHILDREN,
    driver: common.DriverOption = "pdm",
    seed: common.SeedOption = 0,
    out: Annotated[
        Path | None, typer.Option("--out", help="The folder of the mutants, by default that of the clip.")
    ] = None,
    format_: FormatOption = "text",
    junit: JunitOption = None,
    exit_zero: common.ExitZeroOption = False,
    allow_outside: common.AllowOutsideOption = False,
) -> None:
    """Mutate a clip, run the mutants, and write each one with its result, beside the clip or into --out.

    The mutants of a clip in a campaign's folder need --out. A file that is there with other content is not overwritten.

    Exit code 1 when a mutant failed, or broke an `expect` line.

    [dim]foresee mutate clips/red_light_runner_r01_p1.foresee --children 8[/dim]
    """
    from foresee_dsl.campaign.mutate_file import mutate_file
    from foresee_dsl.files import write_whole
    from foresee_dsl.report.builds.case_results import of_child

    outcomes = mutate_file(
        file, preset=preset, count=children, driver=driver, seed=seed, out=out, allow_outside=allow_outside
    )
    for child in outcomes:
        write_whole(Path(child.file), child.text)

    def data() -> str:
        mutants = [
            {"file": c.file, "operators": c.operators, "verdict": c.verdict, "with": c.with_, "reason": c.reason,
             "digest": c.digest}
            for c in outcomes
        ]  # fmt: skip
        return common.json_document({"clip": file, "preset": preset, "children": mutants})

    report_results(
        format_,
        CommandReport(
            "mutate",
            data,
            lambda: [of_child(child, child.file, driver, seed, suite=str(file)) for child in outcomes],
            properties=(("driver", driver), ("seed", str(seed))),
        ),
        people=lambda screen: _print_mutants(screen, outcomes, children, preset),
        junit=junit,
    )
    if not exit_zero and any(not child.passed for child in outcomes):
        raise typer.Exit(common.FAILED)


def _print_mutants(screen: Console, outcomes: Sequence[ChildOutcome], count: int, preset: str) -> None:
    from rich.text import Text

    from foresee_dsl.campaign.mutate_file import why_fewer
    from foresee_dsl.report.safe_text import safe

    for child in outcomes:
        screen.print(Text(f"{child.file}\n  {safe(child.reason)} ({', '.join(child.operators)})"), soft_wrap=True)
    if not outcomes:
        screen.print("nothing was mutated, because no operator can change an actor of this clip", soft_wrap=True)
    elif len(outcomes) < count:
        screen.print(f"{len(outcomes)} of the {count} mutants asked for: {why_fewer(preset)}", soft_wrap=True)


def _load_trace(path: Path) -> Trace:
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.simulate.trace import Trace

    try:
        return Trace.load(path)
    except ValueError as err:
        raise ForeseeError(str(err)) from err


def _points(
    trace: Trace, ranker: str, seed: int, before: float, after: float, *, allow_outside: bool
) -> tuple[RiskyPoint, ...]:
    """Return the ranked risky points; the run's test case is compiled only for a ranker that needs it."""
    from foresee_dsl.forecast.registry import ranker_within

    def compiled() -> SumoBundle:
        from foresee_dsl.compile import compile_test_case
        from foresee_dsl.errors import ForeseeError
        from foresee_dsl.language.project.loading import load_test_case

        case = load_test_case(str(trace.meta["test_case"]), allow_outside=allow_outside)
        if trace.meta.get("meaning", case.meaning) != case.meaning:
            raise ForeseeError(f"{case.id} was edited since this run: run it again, and rank the new trace")
        return compile_test_case(case)

    return ranker_within(ranker, compiled).rank(trace, seed=seed, before_s=before, after_s=after)

"""Commands for single runs and what is derived from them: run, forecast, clip, mutate."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foresee_dsl.cli import common
from foresee_dsl.cli.output import FormatOption, JunitOption, ReportFormat, report_results

if TYPE_CHECKING:
    from foresee_dsl.forecast.protocol import RiskyPoint
    from foresee_dsl.simulate.results.verdict import RunResult
    from foresee_dsl.simulate.trace import Trace

TraceArgument = Annotated[Path, typer.Argument(metavar="TRACE", help="A trace (.npz) that `foresee run` wrote.")]
Before = Annotated[float, typer.Option(min=0.5, max=60, help="Seconds before the risky point.")]
After = Annotated[float, typer.Option(min=0.5, max=60, help="Seconds after it.")]


def run(
    address: common.AddressArgument,
    driver: common.DriverOption = "pdm",
    seed: common.SeedOption = 0,
    out: Annotated[Path | None, typer.Option("--out", help="Keep the trace in this folder.")] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit code 1 unless it passes and every expectation holds.")
    ] = False,
    format_: FormatOption = ReportFormat.text,
    junit: JunitOption = None,
    json: common.JsonOption = False,
    allow_outside: common.AllowOutsideOption = False,
) -> None:
    """Drive through one test case and say how it ended.

    [dim]foresee run scenarios/scenario7.foresee::r01 --out runs[/dim]
    """
    from foresee_dsl.campaign.driving import case_name, run_test_case
    from foresee_dsl.language.project.loading import load_test_case
    from foresee_dsl.report.case_results import of_run
    from foresee_dsl.report.terminal import print_run
    from foresee_dsl.simulate.results.verdict import Verdict

    case = load_test_case(address, allow_outside=allow_outside)
    result = run_test_case(case, driver, seed)
    trace = None
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        trace = out / f"{case_name(case)}.npz"
        result.trace.save(trace)
    report_results(
        ReportFormat.json if json else format_,
        results=lambda: (of_run(case.id, driver, seed, result, (str(trace),) if trace else ()),),
        data=lambda: common.json_document(_run_document(case.id, driver, seed, result, trace)),
        people=lambda screen: print_run(screen, case.id, result, trace),
        junit=junit,
        properties=(("driver", driver), ("seed", str(seed))),
    )
    if strict and (result.verdict is not Verdict.PASS or not all(e.held for e in result.expectations)):
        raise typer.Exit(common.FAILED)


def _run_document(address: str, driver: str, seed: int, result: RunResult, trace: Path | None) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "schema": 1,
        "test_case": address,
        "driver": driver,
        "seed": seed,
        "verdict": result.verdict.value,
        "time_s": round(result.time_s, 2),
        "with": result.with_,
        "reason": result.reason,
        "impact": result.impact.as_dict() if result.impact else None,
        "near_misses": result.near_misses.as_dict(),
        "duration_s": round(result.duration_s, 2),
        "steps": result.steps,
        "expectations": [asdict(expectation) for expectation in result.expectations],
        "trace": str(trace) if trace else None,
        "digest": result.trace.digest,
    }


def forecast(
    trace: TraceArgument,
    ranker: common.RankerOption = "foresee",
    seed: common.SeedOption = 0,
    before: Before = 5.0,
    after: After = 5.0,
    json: common.JsonOption = False,
) -> None:
    """Rank the moments of a run around which a failure may hide.

    [dim]foresee forecast runs/red_light_runner_r01.npz --ranker proximity[/dim]
    """
    points = _points(_load_trace(trace), ranker, seed, before, after)
    if json:
        found = [_point_dict(p) for p in points]
        common.print_json({"schema": 1, "trace": str(trace), "ranker": ranker, "risky_points": found})
        return
    from foresee_dsl.report.terminal import print_points

    print_points(common.console(), points)


def clip(
    trace: TraceArgument,
    ranker: common.RankerOption = "foresee",
    rank: Annotated[int, typer.Option(min=1, help="Which risky point of the ranked list.")] = 1,
    seed: common.SeedOption = 0,
    before: Before = 5.0,
    after: After = 5.0,
    handover: common.HandoverOption = 0.0,
    out: common.OutOption = Path("clips"),
    json: common.JsonOption = False,
    allow_outside: common.AllowOutsideOption = False,
) -> None:
    """Cut the seconds around a risky point out of a run and write them as a clip file.

    The clip is run once, unmutated: its `fidelity` line says how far it strays from its parent.

    [dim]foresee clip runs/red_light_runner_r01.npz --rank 2 --out clips[/dim]
    """
    from foresee_dsl.campaign.driving import case_name
    from foresee_dsl.campaign.steps.clip import measure_clip
    from foresee_dsl.campaign.steps.forecast import clip_around
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.files import write_whole
    from foresee_dsl.language.printer import print_model
    from foresee_dsl.language.project.loading import load_test_case

    loaded = _load_trace(trace)
    points = _points(loaded, ranker, seed, before, after)
    if rank > len(points):
        raise ForeseeError(f"{trace} has {len(points)} risky points by {ranker}, so there is no rank {rank}")
    point = points[rank - 1]
    case = load_test_case(str(loaded.meta["test_case"]), allow_outside=allow_outside)
    file = out / f"{case_name(case)}_p{rank}.foresee"
    try:
        model = clip_around(case, loaded, point, file, before_s=before, after_s=after, handover_s=handover)
    except ValueError as err:
        raise ForeseeError(str(err)) from err
    driver, run_seed = str(loaded.meta["driver"]), int(loaded.meta["seed"])
    model, _, _, found = measure_clip(model, case, loaded, file, driver=driver, seed=run_seed)
    write_whole(file, print_model(model))
    if json:
        fidelity = {"fidelity_m": round(found.largest_others_m, 4), "fidelity_ego_m": round(found.ego_m, 4)}
        common.print_json({"schema": 1, "clip": str(file), **fidelity, **_point_dict(point)})
    else:
        strays = f"fidelity {found.largest_others_m:.2f} m, of the ego {found.ego_m:.2f} m"
        typer.echo(f"{file}\n  {point.why}\n  {strays}")


def mutate(
    file: Annotated[Path, typer.Argument(metavar="CLIP", help="A clip's file.")],
    preset: common.PresetOption = "focused",
    children: Annotated[int, typer.Option(min=1, max=1000, help="How many.")] = 4,
    driver: common.DriverOption = "pdm",
    seed: common.SeedOption = 0,
    json: common.JsonOption = False,
    allow_outside: common.AllowOutsideOption = False,
) -> None:
    """Mutate a clip, run the children, and write each beside the clip, with what it found.

    [dim]foresee mutate clips/red_light_runner_r01_p1.foresee --children 8[/dim]
    """
    from foresee_dsl.campaign.mutate_file import mutate_file
    from foresee_dsl.files import write_whole

    outcomes = mutate_file(file, preset=preset, count=children, driver=driver, seed=seed, allow_outside=allow_outside)
    for child in outcomes:
        write_whole(Path(child.file), child.text)
    if json:
        common.print_json(
            {
                "schema": 1,
                "clip": str(file),
                "preset": preset,
                "children": [
                    {"file": c.file, "operators": list(c.operators), "verdict": c.verdict.value, "with": c.with_,
                     "reason": c.reason, "digest": c.digest}
                    for c in outcomes
                ],
            }
        )  # fmt: skip
        return
    for child in outcomes:
        typer.echo(f"{child.file}\n  {child.reason} ({', '.join(child.operators)})")
    if not outcomes:
        typer.echo("nothing to mutate: no operator can act on an actor of this clip")


def _load_trace(path: Path) -> Trace:
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.simulate.trace import Trace

    try:
        return Trace.load(path)
    except ValueError as err:
        raise ForeseeError(str(err)) from err


def _points(trace: Trace, ranker: str, seed: int, before: float, after: float) -> tuple[RiskyPoint, ...]:
    from foresee_dsl.forecast.registry import load_ranker

    return load_ranker(ranker).rank(trace, seed=seed, before_s=before, after_s=after)


def _point_dict(point: RiskyPoint) -> dict[str, object]:
    return {
        "rank": point.rank,
        "time_s": round(point.time_s, 2),
        "frame": point.frame,
        "actor": point.actor,
        "group": point.group,
        "distance_m": None if point.distance_m != point.distance_m else round(point.distance_m, 3),
        "why": point.why,
    }

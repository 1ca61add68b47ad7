"""What the exporters of runs share: each test case is run once, and its trace is written by the format."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from foresee_dsl.campaign.driving import case_name
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.exchange.outcome import Imported, import_together
from foresee_dsl.exchange.protocol import Tell
from foresee_dsl.exchange.recorded import runs
from foresee_dsl.files import templates
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y
from foresee_recordings.exporting.options import RunOptions
from foresee_recordings.recording import RecordedMap, Recording, Track

TEMPLATES = Path(__file__).parents[1] / "templates"


@dataclass(frozen=True)
class Run:
    """A run to write.

    Attributes:
        name: of its files. number: its place among the runs of the export, from 0.
        recording: the motion of all actors, the ego first. models: the name of each actor's model.
    """

    name: str
    number: int
    bundle: SumoBundle
    trace: Trace
    recording: Recording
    models: dict[str, str]


def export(
    options: RunOptions, tell: Tell, write: Callable[[Path, Run], None], left_out: Callable[[Run], Counter[str]]
) -> Imported:
    """Run the test cases of the options, and write each run.

    Args:
        write: writes the files of a run into a folder. left_out: counts what the format does not express.

    Raises:
        ExchangeError: `out` cannot be written, or a mutant records a program as its driver.
        InputError, CompileError, DriverError: a test case cannot be run.
    """

    def write_all(folder: Path) -> Imported:
        lost: Counter[str] = Counter()
        taken: Counter[str] = Counter()
        notes = []
        exported = runs(
            options.addresses,
            driver=options.driver,
            seed=options.seed,
            allow_outside=options.allow_outside,
            tell=tell,
        )
        for number, item in enumerate(exported):
            trace, name = item.result.trace, case_name(item.case)
            models = {actor.id: actor.model for actor in trace.actors}
            run = Run(name, number, item.bundle, trace, recording_of(trace, name), models)
            write(folder, run)
            taken.update(f"of class {track.kind}" for track in run.recording.tracks)
            taken["frames"] += trace.frames
            lost.update(left_out(run))
            notes.append(item.note)
        return Imported((), len(options.addresses), dict(sorted(taken.items())), +lost, tuple(notes))

    return import_together(options.out, write_all)


def lost_in_all(run: Run) -> Counter[str]:
    """Return counts of what none of these formats expresses."""
    scene = run.bundle.scene
    return Counter({"triggers": len(scene.whens), "expectations": len(scene.expects)})


def render(file: Path, template: str, **values: object) -> None:
    """Write a file from a template of this plug-in, such as `fcd.xml`."""
    text = templates(str(TEMPLATES)).get_template(f"{template}.j2").render(**values)
    file.write_text(text, encoding="utf-8", newline="\n")


def recording_of(trace: Trace, name: str = "run", roads: RecordedMap | None = None) -> Recording:
    """Return a run as a recording; its actors keep their names."""
    tracks = []
    for k, info in enumerate(trace.actors):
        present = np.flatnonzero(~np.isnan(trace.states[:, k, X]))
        if len(present):
            states = trace.states[present, k][:, [X, Y, HEADING, SPEED]]
            tracks.append(Track(info.id, info.kind, info.length_m, info.width_m, trace.time_s[present], states))
    return Recording(
        name, Path(f"{name}.npz"), trace.digest.removeprefix("sha256:"), "trace", tuple(tracks), roads=roads
    )

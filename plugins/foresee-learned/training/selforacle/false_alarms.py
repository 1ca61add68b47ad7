"""Counts SelfOracle's false alarms on new nominal driving: `python -m training.selforacle.false_alarms --driver
fusion`.

For a driver whose weights changed after its watcher was trained. The rides are those of `rides`, with seeds that were
not used for training.
"""

from __future__ import annotations

import argparse

from foresee_study.selforacle.ranker import ConvolutionalRanker, SelfOracleRanker
from foresee_study.selforacle.watcher import watcher_of

from training.selforacle.rides import drive

FIRST = 900_000
"""Seed of the first ride."""


def main() -> None:
    """Drive rides, and count alarms in those that were nominal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--driver", default="pdm")
    parser.add_argument("--first", type=int, default=FIRST, help="seed of the first ride")
    parser.add_argument("--rides", type=int, default=20)
    options = parser.parse_args()
    thresholds = {
        kind: watcher_of(kind.name, options.driver).threshold for kind in (SelfOracleRanker, ConvolutionalRanker)
    }
    alarms, segments, rides = dict.fromkeys(thresholds, 0), 0, 0
    for ride in drive(options.driver, range(options.first, options.first + options.rides)):
        if not ride.nominal:
            continue
        rides += 1
        for kind, threshold in thresholds.items():
            ride_segments = kind().within(ride.surroundings).segments(ride.result.trace)
            alarms[kind] += sum(segment.error > threshold for segment in ride_segments)
        segments += len(ride_segments)
        summary = ", ".join(f"{kind.name} {count / segments:.1%}" for kind, count in alarms.items())
        print(f"{rides} rides, {segments} segments: {summary}", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()

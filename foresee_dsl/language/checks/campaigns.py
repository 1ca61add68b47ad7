"""A campaign's file: what it needs, and what may be said only once."""

from __future__ import annotations

from foresee_dsl.language import model as m
from foresee_dsl.language.checks.findings import Findings

_ONCE: tuple[tuple[type[m.Item], str], ...] = (
    (m.Drivers, "drivers"),
    (m.Rankers, "rankers"),
    (m.Preset, "preset"),
    (m.ClipAround, "clip"),
    (m.RiskyPoints, "risky_points"),
    (m.Children, "children"),
    (m.Repeat, "repeat"),
    (m.FirstSeed, "seed"),
    (m.Budget, "budget"),
)


def check_campaign(findings: Findings, campaign: m.Campaign) -> None:
    """Check a campaign's file; whether its drivers, rankers and files exist is known where it is run."""
    if not any(isinstance(item, m.Seeds) for item in campaign.body):
        help = 'say which test cases it runs: `seeds "scenarios/**"`'
        findings.add(campaign, "name", "FS057", f"campaign '{campaign.name}' has no `seeds`", help)
    for kind, word in _ONCE:
        findings.only_once([item for item in campaign.body if isinstance(item, kind)], f"`{word}`")
    for item in campaign.body:
        if isinstance(item, m.Drivers | m.Rankers):
            _each_once(findings, item)


def _each_once(findings: Findings, item: m.Drivers | m.Rankers) -> None:
    for k, name in enumerate(item.names):
        if name in item.names[:k]:
            findings.add(item, f"names.{k}", "FS013", f"'{name}' is said twice", "keep one of the two")

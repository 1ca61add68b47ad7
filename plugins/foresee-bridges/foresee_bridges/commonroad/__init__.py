"""CommonRoad: planners that take a `Scenario` and a `PlanningProblem` as drivers (`--driver commonroad:reactive`).

The program `python -m foresee_bridges.commonroad PLANNER` needs numpy and the packages of CommonRoad, not foresee-dsl,
so that it can live in an environment of its own; `driver` alone imports foresee-dsl.
"""

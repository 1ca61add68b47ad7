"""nuPlan: planners written for nuplan-devkit as drivers (`--driver nuplan:module:Planner`)."""

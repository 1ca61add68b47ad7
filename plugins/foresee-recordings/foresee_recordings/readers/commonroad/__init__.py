"""CommonRoad scenarios: their obstacles, traffic lights and lanelets."""

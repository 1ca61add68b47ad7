# The benchmark's town with twenty cars that follow their lanes; the first is the ego.
model scenic.simulators.newtonian.driving_model

ego = new Car with behavior FollowLaneBehavior(target_speed=11)

for _ in range(globalParameters.others):
    new Car with behavior FollowLaneBehavior(target_speed=10)

terminate after 10 seconds

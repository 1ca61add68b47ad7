"""A street with a neighbour beside the ego, and others that play no part when it comes over."""

STREET = """foresee 1

# A neighbour drives beside the ego; four others are about.
scenario beside {
  network street {
    junction west at (0 m, 0 m)
    junction east at (400 m, 0 m)
    road street from west to east { lanes 2; speed 50 km/h }
  }

  ego: car.sedan {
    route [street]
    start at 60 m along street
    start speed 36 km/h
    goal 300 m along street
  }
  vehicle neighbour: car.compact {
    route [street]
    start at 66 m along street offset 3.3 m
    start speed 36 km/h
    speed 36 km/h
  }
  vehicle ahead: car.suv {
    route [street]
    start at 160 m along street
    start speed 40 km/h
    speed 40 km/h
  }
  vehicle behind: van.parcel {
    route [street]
    start at 10 m along street
    start speed 30 km/h
    speed 30 km/h
  }
  obstacle parked: obstacle.parked_car {
    start at 250 m along street offset -6 m
  }
  pedestrian walker: pedestrian.adult {
    path [(40 m, -9 m), (10 m, -9 m)]
  }

  when time > 4 s {
    ahead changes speed to 42 km/h
  }

  expect never collision(ego)
  end after 14 s anywhere
}
"""

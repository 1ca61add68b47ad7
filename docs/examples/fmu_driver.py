"""A driver as an FMU: follows the route, the speed limit, stop lines at red and the vehicle ahead.

Build it with `pythonfmu3 build -f fmu_driver.py`, then `foresee run scenarios --driver fmi:KeepingDriver.fmu`.
"""

from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave

INPUTS = {
    "host_vehicle_data.vehicle_motion.velocity.x": "speed",
    "route.steering_angle": "angle",
    "route.bend_speed": "wanted",
    "route.stop_distance": "stop",
    "route.signal.color": "color",
    "lead.distance": "gap",
    "lead.speed": "lead_speed",
}
RED, AMBER = 2, 3
BRAKING, STOP_GAP = 3.0, 2.0  # m/s2, m


class KeepingDriver(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = self.steering = self.acceleration = 0.0
        self.register_variable(self.number("time", "time", Fmi3Causality.independent))
        for name, attribute in INPUTS.items():
            setattr(self, attribute, 0.0)
            self.register_variable(self.number(name, attribute, Fmi3Causality.input))
        self.register_variable(self.number("control.steering_angle", "steering", Fmi3Causality.output))
        self.register_variable(self.number("control.acceleration", "acceleration", Fmi3Causality.output))

    def number(self, name, attribute, causality):
        def get():
            return getattr(self, attribute)

        return Float64(name, causality=causality, getter=get, setter=lambda value: setattr(self, attribute, value))

    def do_step(self, _time, _step_size):
        ends = [(self.gap - STOP_GAP, self.lead_speed)]
        if self.color in (RED, AMBER):
            ends.append((self.stop, 0.0))
        self.acceleration = min(2.0, self.wanted - self.speed)
        for distance, speed in ends:  # the constant braking that leads to this speed at this place
            needed = (self.speed**2 - speed**2) / (2 * max(distance, 0.1))
            if needed > BRAKING / 2:
                self.acceleration = min(self.acceleration, -needed)
        self.steering = self.angle
        return True

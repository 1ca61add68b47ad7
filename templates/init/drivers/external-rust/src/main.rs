//! A driver for foresee: keeps its lane, the limit and its distance, stops at red, and brakes for actors that come into
//! its way.
//!
//! foresee writes lines of JSON to standard input; each is answered with one line. Text for people goes to standard
//! error. Replace `drive` by a call of your software. Coordinates: x east, y north, m; headings counter-clockwise from
//! east, rad.

mod json;

use json::Value;
use std::f64::consts::{PI, TAU};
use std::io::{self, BufRead, Write};

const BRAKING_MPS2: f64 = 2.0; // comfortable; the pedal is pressed further if the ego is still too fast
const GAP_M: f64 = 3.0; // to whatever it stops for
const TIMES_S: [f64; 5] = [0.0, 0.5, 1.0, 1.5, 2.0]; // for which the motion of others is predicted

/// Steer from -1 (right) to 1 (left), throttle and brake from 0 to 1.
struct Control {
    steer: f64,
    throttle: f64,
    brake: f64,
}

struct Task {
    mission: Value,
    car: Value,
    /// The lane centres to follow, and the length along them, m.
    line: Vec<(f64, f64)>,
    s: Vec<f64>,
}

impl Task {
    fn new(reset: &Value) -> Task {
        let mission = reset["mission"].clone();
        let points = mission["centreline"].items();
        let line = points.iter().map(|point| (point.items()[0].number(), point.items()[1].number())).collect();
        let s = mission["s"].items().iter().map(Value::number).collect();
        Task { mission, car: reset["vehicle"].clone(), line, s }
    }

    /// The index of the route's point nearest to a place.
    fn nearest(&self, x: f64, y: f64) -> usize {
        let away = |k: usize| (self.line[k].0 - x).hypot(self.line[k].1 - y);
        (0..self.line.len()).fold(0, |best, k| if away(k) < away(best) { k } else { best })
    }

    /// The first point of the route from a length on.
    fn point(&self, at_s: f64) -> (f64, f64) {
        let k = self.s.iter().position(|&length| length >= at_s).unwrap_or(self.line.len() - 1);
        self.line[k]
    }
}

/// Return an angle between -pi and pi.
fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

/// Return the distance from the ego's front to where it has to stop, m.
fn room(task: &Task, seen: &Value, front_s: f64) -> f64 {
    let mut room_m: f64 = 1000.0;
    for junction in task.mission["junctions"].items() {
        let colour = seen["signals"].get(junction["signal"].text()).map_or("", Value::text);
        let stop_s = junction["stop_s"].number();
        if (colour == "red" || colour == "amber") && stop_s > front_s - 1.0 {
            room_m = room_m.min(stop_s - 1.0 - front_s);
        }
    }
    for actor in seen["actors"].items() {
        for ahead_s in TIMES_S {
            let way_m = actor["speed_mps"].number() * ahead_s;
            let heading_rad = actor["heading_rad"].number();
            let x = actor["x"].number() + way_m * heading_rad.cos();
            let y = actor["y"].number() + way_m * heading_rad.sin();
            let near = task.nearest(x, y);
            let aside_m = (task.line[near].0 - x).hypot(task.line[near].1 - y);
            let away_m = task.s[near] - front_s;
            let clear_m = (actor["width_m"].number() + task.car["width_m"].number()) / 2.0 + 0.4;
            let same_time = (away_m / seen["ego"]["speed_mps"].number().max(3.0) - ahead_s).abs() < 1.5;
            if aside_m < clear_m && away_m > 0.0 && (same_time || ahead_s == 0.0) {
                let half_m = if ahead_s == 0.0 { actor["length_m"].number() / 2.0 } else { 0.0 };
                room_m = room_m.min(away_m - half_m - GAP_M);
            }
        }
    }
    room_m
}

fn drive(task: &Task, seen: &Value) -> Control {
    let (ego, car) = (&seen["ego"], &task.car);
    let (heading_rad, speed_mps) = (ego["heading_rad"].number(), ego["speed_mps"].number());
    let (wheelbase_m, length_m) = (car["wheelbase_m"].number(), car["length_m"].number());
    let back_m = wheelbase_m + car["front_overhang_m"].number() - length_m / 2.0; // from the centre to the rear axle
    let x = ego["x"].number() - back_m * heading_rad.cos();
    let y = ego["y"].number() - back_m * heading_rad.sin();
    let here = task.nearest(x, y);

    // Pure pursuit: the circle through the rear axle and a point ahead on the route.
    let aim = task.point(task.s[here] + 4.0 + 0.5 * speed_mps);
    let turn = wrapped((aim.1 - y).atan2(aim.0 - x) - heading_rad);
    let wheels_rad = (2.0 * wheelbase_m * turn.sin()).atan2((aim.0 - x).hypot(aim.1 - y));

    let far = task.point(task.s[here] + 20.0);
    let bend = wrapped((far.1 - y).atan2(far.0 - x) - heading_rad).abs();
    let limit_mps = task.mission["speed_limit_mps"].items()[here].number() / (1.0 + 4.0 * bend);
    let room_m = room(task, seen, task.s[here] + back_m + length_m / 2.0).max(0.0);
    let missing_mps = limit_mps.min((2.0 * BRAKING_MPS2 * room_m).sqrt()) - speed_mps;
    Control {
        steer: (wheels_rad / car["steer_max_rad"].number()).clamp(-1.0, 1.0),
        throttle: missing_mps.clamp(0.0, 1.0),
        brake: (-missing_mps / 3.0).clamp(0.0, 1.0),
    }
}

/// Answer each line until `end`.
fn main() -> io::Result<()> {
    let mut task = None;
    let mut out = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let message = json::parse(&line?).map_err(io::Error::other)?;
        match message["type"].text() {
            "reset" => {
                task = Some(Task::new(&message));
                writeln!(out, r#"{{"type": "ready", "name": "my_driver", "version": "1"}}"#)?;
            }
            "step" => {
                let task = task.as_ref().expect("a reset comes before the first step");
                let control = drive(task, &message["observation"]);
                writeln!(
                    out,
                    r#"{{"steer": {}, "throttle": {}, "brake": {}}}"#,
                    control.steer, control.throttle, control.brake
                )?;
            }
            _ => break,
        }
        out.flush()?;
    }
    Ok(())
}

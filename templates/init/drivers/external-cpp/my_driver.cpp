// A driver for foresee: keeps its lane, the limit and its distance, stops at red, and brakes for actors that come into
// its way.
//
// foresee writes lines of JSON to standard input; each is answered with one line. Text for people goes to standard
// error. Replace `drive` by a call of your software. Coordinates: x east, y north, m; headings counter-clockwise from
// east, rad.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "json.hpp"

namespace {

constexpr double kBrakingMps2 = 2.0;  // comfortable; the pedal is pressed further if the ego is still too fast
constexpr double kGapM = 3.0;         // to whatever it stops for
constexpr double kAheadS = 2.0;       // how far the motion of others is predicted
constexpr double kTurn = 6.283185307179586;

struct Point {
    double x, y;
};

struct Control {
    double steer;  // from -1 (right) to 1 (left)
    double throttle, brake;  // from 0 to 1
};

struct Task {
    json::Value mission, car;
    std::vector<Point> line;  // the lane centres to follow
    std::vector<double> s;    // length along them, m

    explicit Task(const json::Value& reset) : mission(reset["mission"]), car(reset["vehicle"]) {
        for (const auto& point : mission["centreline"].items) {
            line.push_back({point.items[0].number, point.items[1].number});
        }
        for (const auto& length : mission["s"].items) s.push_back(length.number);
    }

    // The index of the route's point nearest to a place.
    std::size_t nearest(double x, double y) const {
        std::size_t best = 0;
        for (std::size_t k = 1; k < line.size(); ++k) {
            if (std::hypot(line[k].x - x, line[k].y - y) < std::hypot(line[best].x - x, line[best].y - y)) best = k;
        }
        return best;
    }

    // The first point of the route from a length on.
    Point point(double at_s) const {
        for (std::size_t k = 0; k < s.size(); ++k) {
            if (s[k] >= at_s) return line[k];
        }
        return line.back();
    }
};

// The distance from the ego's front to where it has to stop, m.
double room(const Task& task, const json::Value& seen, double front_s) {
    double room_m = 1000;
    for (const auto& junction : task.mission["junctions"].items) {
        const std::string& signal = junction["signal"].text;  // "": there is none
        if (signal.empty() || !seen["signals"].has(signal)) continue;
        const std::string& colour = seen["signals"][signal].text;
        const double stop_s = junction["stop_s"].number;
        if ((colour == "red" || colour == "amber") && stop_s > front_s - 1) {
            room_m = std::min(room_m, stop_s - 1 - front_s);
        }
    }
    for (const auto& actor : seen["actors"].items) {
        for (double ahead_s = 0; ahead_s <= kAheadS; ahead_s += 0.5) {
            const double way_m = actor["speed_mps"].number * ahead_s;
            const double x = actor["x"].number + way_m * std::cos(actor["heading_rad"].number);
            const double y = actor["y"].number + way_m * std::sin(actor["heading_rad"].number);
            const std::size_t near = task.nearest(x, y);
            const double aside_m = std::hypot(task.line[near].x - x, task.line[near].y - y);
            const double away_m = task.s[near] - front_s;
            const double clear_m = (actor["width_m"].number + task.car["width_m"].number) / 2 + 0.4;
            const double ego_mps = std::max(seen["ego"]["speed_mps"].number, 3.0);
            const bool same_time = std::abs(away_m / ego_mps - ahead_s) < 1.5;
            if (aside_m < clear_m && away_m > 0 && (same_time || ahead_s == 0)) {
                const double half_m = ahead_s == 0 ? actor["length_m"].number / 2 : 0;
                room_m = std::min(room_m, away_m - half_m - kGapM);
            }
        }
    }
    return room_m;
}

Control drive(const Task& task, const json::Value& seen) {
    const auto& ego = seen["ego"];
    const double heading_rad = ego["heading_rad"].number, speed_mps = ego["speed_mps"].number;
    const double wheelbase_m = task.car["wheelbase_m"].number, length_m = task.car["length_m"].number;
    const double back_m = wheelbase_m + task.car["front_overhang_m"].number - length_m / 2;  // centre to rear axle
    const double x = ego["x"].number - back_m * std::cos(heading_rad);
    const double y = ego["y"].number - back_m * std::sin(heading_rad);
    const std::size_t here = task.nearest(x, y);

    // Pure pursuit: the circle through the rear axle and a point ahead on the route.
    const Point aim = task.point(task.s[here] + 4 + 0.5 * speed_mps);
    const double turn = std::remainder(std::atan2(aim.y - y, aim.x - x) - heading_rad, kTurn);
    const double wheels_rad = std::atan2(2 * wheelbase_m * std::sin(turn), std::hypot(aim.x - x, aim.y - y));

    const Point far = task.point(task.s[here] + 20);
    const double bend = std::abs(std::remainder(std::atan2(far.y - y, far.x - x) - heading_rad, kTurn));
    const double limit_mps = task.mission["speed_limit_mps"].items[here].number / (1 + 4 * bend);
    const double room_m = std::max(room(task, seen, task.s[here] + back_m + length_m / 2), 0.0);
    const double missing_mps = std::min(limit_mps, std::sqrt(2 * kBrakingMps2 * room_m)) - speed_mps;
    return {
        std::clamp(wheels_rad / task.car["steer_max_rad"].number, -1.0, 1.0),
        std::clamp(missing_mps, 0.0, 1.0),
        std::clamp(-missing_mps / 3, 0.0, 1.0),
    };
}

// Answer each line until `end`.
void answer_all() {
    std::vector<Task> task;  // none, or the task of this run
    for (std::string line; std::getline(std::cin, line);) {
        const json::Value message = json::parse(line);
        const std::string& type = message["type"].text;
        if (type == "reset") {
            task.assign(1, Task(message));
            std::puts(R"({"type": "ready", "name": "my_driver", "version": "1"})");
        } else if (type == "step") {
            const Control control = drive(task.at(0), message["observation"]);
            std::printf("{\"steer\": %.17g, \"throttle\": %.17g, \"brake\": %.17g}\n", control.steer, control.throttle,
                        control.brake);
        } else {
            return;
        }
        std::fflush(stdout);
    }
}

}  // namespace

int main() {
    try {
        answer_all();
    } catch (const std::exception& error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
    return 0;
}

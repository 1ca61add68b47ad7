// Reads the vehicles of SUMO after a step, for `foresee_native`. It calls the same functions of SUMO, in the same order,
// as `PythonReader` in `foresee_dsl/simulate/vehicle_reader.py`, which describes the results.
//
// The functions have C linkage, so that Python calls them through ctypes. No exception leaves them.

#include <libsumo/Lane.h>
#include <libsumo/TraCIDefs.h>
#include <libsumo/Vehicle.h>

#include <algorithm>
#include <exception>
#include <string>
#include <utility>
#include <vector>

namespace {

// Results that are not a number of vehicles; `foresee_native/__init__.py` has the same.
constexpr int OTHER_VEHICLES = -1;
constexpr int SUMO_FAILED = -2;

struct Reader {
    std::vector<std::string> on_road;  // all vehicles in SUMO when `names` was set
    std::vector<std::string> names;    // the vehicles that are read
    std::vector<std::string> lanes;    // their lanes at the last read
    std::vector<std::string> bodies;   // the vehicles on whose lanes the order is checked
};

// Returns the lines of a text; each of them ends with a line break.
std::vector<std::string> lines_of(const char* text) {
    std::vector<std::string> lines;
    const char* begin = text;
    for (const char* at = text; *at != '\0'; ++at) {
        if (*at == '\n') {
            lines.emplace_back(begin, at);
            begin = at + 1;
        }
    }
    return lines;
}

// Returns the lane of a body; a body that has reached the end of its route has none.
std::string lane_of(const std::string& body) {
    try {
        return libsumo::Vehicle::getLaneID(body);
    } catch (const libsumo::TraCIException&) {
        return "";
    }
}

bool is_in_order(const std::string& lane) {
    const std::vector<std::string> queue = libsumo::Lane::getLastStepVehicleIDs(lane);
    if (queue.size() < 2) {
        return true;
    }
    double before = libsumo::Vehicle::getLanePosition(queue.front());
    for (std::size_t k = 1; k < queue.size(); ++k) {
        const double here = libsumo::Vehicle::getLanePosition(queue[k]);
        if (here < before) {
            return false;
        }
        before = here;
    }
    return true;
}

bool are_in_order(const std::vector<std::string>& bodies) {
    std::vector<std::string> lanes;
    for (const std::string& body : bodies) {
        std::string lane = lane_of(body);
        if (lane.empty() || std::find(lanes.begin(), lanes.end(), lane) != lanes.end()) {
            continue;
        }
        if (!is_in_order(lane)) {
            return false;
        }
        lanes.push_back(std::move(lane));
    }
    return true;
}

}  // namespace

extern "C" {

Reader* foresee_new() { return new Reader(); }

void foresee_delete(Reader* reader) { delete reader; }

// Reads the vehicles `names` from now on, as long as SUMO has the vehicles `on_road`; both are lines.
void foresee_follow(Reader* reader, const char* names, const char* on_road) {
    reader->names = lines_of(names);
    reader->on_road = lines_of(on_road);
    reader->lanes.assign(reader->names.size(), "");
}

// numbers: receives x, y of each vehicle, then all speeds. changed: receives the indices of the vehicles on another lane
// than at the last read. Returns how many these are.
int foresee_read(Reader* reader, double* numbers, int* changed) {
    try {
        if (libsumo::Vehicle::getIDList() != reader->on_road) {
            return OTHER_VEHICLES;
        }
        const std::size_t count = reader->names.size();
        int changes = 0;
        for (std::size_t k = 0; k < count; ++k) {
            const std::string& name = reader->names[k];
            const libsumo::TraCIPosition place = libsumo::Vehicle::getPosition(name);
            numbers[2 * k] = place.x;
            numbers[2 * k + 1] = place.y;
            numbers[2 * count + k] = libsumo::Vehicle::getSpeed(name);
            std::string lane = libsumo::Vehicle::getLaneID(name);
            if (lane != reader->lanes[k]) {
                reader->lanes[k] = std::move(lane);
                changed[changes++] = static_cast<int>(k);
            }
        }
        return changes;
    } catch (const std::exception&) {
        return SUMO_FAILED;
    }
}

// Returns the lane of a vehicle; the text is valid until the next read.
const char* foresee_lane(const Reader* reader, int index) { return reader->lanes[index].c_str(); }

// Sets the vehicles on whose lanes the order is checked; `bodies` are lines.
void foresee_watch(Reader* reader, const char* bodies) { reader->bodies = lines_of(bodies); }

// Returns 1 if the vehicles on the lanes of the watched bodies are in the order of their positions, 0 if not.
int foresee_in_order(const Reader* reader) {
    try {
        return are_in_order(reader->bodies) ? 1 : 0;
    } catch (const std::exception&) {
        return SUMO_FAILED;
    }
}

}  // extern "C"

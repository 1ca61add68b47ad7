// Reads all vehicles of the SUMO in this process, as a step of foresee-dsl does; see bound.py.

#include <libsumo/TraCIDefs.h>
#include <libsumo/Vehicle.h>

#include <exception>
#include <string>
#include <vector>

extern "C" {

// values: receives x, y, speed and the length of the lane's name of at most `most` vehicles. Returns their number, or -1
// if SUMO failed; no exception leaves it.
int read_vehicles(double* values, int most) {
    try {
        int count = 0;
        for (const std::string& name : libsumo::Vehicle::getIDList()) {
            if (count == most) {
                break;
            }
            const libsumo::TraCIPosition place = libsumo::Vehicle::getPosition(name);
            values[4 * count] = place.x;
            values[4 * count + 1] = place.y;
            values[4 * count + 2] = libsumo::Vehicle::getSpeed(name);
            values[4 * count + 3] = static_cast<double>(libsumo::Vehicle::getLaneID(name).size());
            ++count;
        }
        return count;
    } catch (const std::exception&) {
        return -1;
    }
}

}  // extern "C"

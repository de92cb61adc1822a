// One allocator, with the arrays through which a page calls it. KERNEL, HEADER and the sizes come from the command line.

#include HEADER

#include <math.h>

#define PASTE(a, b) a##b
#define NAMED(kind, what) PASTE(kind, what)
#define EXPORT(what) __attribute__((export_name(TEXT(KIND) what)))
#define TEXT_OF(word) #word
#define TEXT(word) TEXT_OF(word)

static double params[PARAMS], memory[MEMORY], force[3], tensions[DRONES], directions[3 * DRONES], info[7];
static double moment[3], reference[4 * 3], rates[3 * 3], attitude[4] = {1}, nominal[9 * DRONES], formation[3 * DRONES];

EXPORT("_params") double *NAMED(KIND, _params)(void) { return params; }
EXPORT("_memory") double *NAMED(KIND, _memory)(void) { return memory; }
EXPORT("_force") double *NAMED(KIND, _force)(void) { return force; }
EXPORT("_tensions") double *NAMED(KIND, _tensions)(void) { return tensions; }
EXPORT("_directions") double *NAMED(KIND, _directions)(void) { return directions; }
EXPORT("_info") double *NAMED(KIND, _info)(void) { return info; }

EXPORT("_ask") int NAMED(KIND, _ask)(int n, double dt)
{
    const colift_now now = {0, 0.0, dt};
    const colift_allocation_sees sees = {
        .n = n, .force = force, .moment = moment, .reference = reference, .reference_attitude = attitude,
        .reference_rates = rates, .estimated_load_attitude = attitude, .nominal_forces = nominal, .formation = formation,
    };
    const colift_allocation_writes writes = {
        .n = n, .desired_tensions = tensions, .desired_directions = directions, .allocator_info = info,
    };
    for (int k = 0; k < 9 * n; ++k) {
        nominal[k] = NAN; // nothing is planned
    }
    return KERNEL(&now, &sees, params, memory, &writes);
}

// Calls of an allocator from a file, and its answers into another.
// KERNEL, REAL and the sizes DRONES, PARAMS, MEMORY (the most) come from the command line.

#include "colift.h"
#include "machine.h"

#include <math.h>

#define INFO 7

static REAL params[PARAMS + 1], memory[MEMORY + 1];
static REAL force[3], moment[3], reference[4 * 3], rates[3 * 3], attitude[4] = {1}, wanted[4] = {1};
static REAL nominal[DRONES * 9], formation[DRONES * 3];
static REAL tensions[DRONES], directions[DRONES * 3], info[INFO];
static double row[2 + INFO + 4 * DRONES];

static void take(REAL *to, int count)
{
    for (int k = 0; k < count; ++k) {
        double value;
        machine_take(&value, (int)sizeof value);
        to[k] = (REAL)value;
    }
}

int main(void)
{
    int head[4];
    double dt;
    machine_begin();
    machine_take(head, (int)sizeof head); // drones, calls, parameters, memory
    machine_take(&dt, (int)sizeof dt);
    const int n = head[0];
    take(params, head[2]);
    take(memory, head[3]);
    take(directions, 3 * n);
    take(attitude, 4);
    take(formation, 3 * n);
    for (int k = 0; k < 9 * n; ++k) {
        nominal[k] = (REAL)NAN;
    }
    const colift_allocation_sees sees = {
        .n = n, .force = force, .moment = moment, .reference = reference, .reference_attitude = wanted,
        .reference_rates = rates, .estimated_load_attitude = attitude, .nominal_forces = nominal, .formation = formation,
    };
    const colift_allocation_writes writes = {
        .n = n, .desired_tensions = tensions, .desired_directions = directions, .allocator_info = info,
    };
    int deepest = 0;
    for (int call = 0; call < head[1]; ++call) {
        const colift_now now = {call, (REAL)(call * dt), (REAL)dt};
        take(force, 3);
        take(moment, 3);
        machine_paint();
        const double before = machine_instructions();
        row[0] = KERNEL(&now, &sees, params, memory, &writes);
        row[1] = machine_instructions() - before;
        const int used = machine_used();
        deepest = used > deepest ? used : deepest;
        for (int k = 0; k < INFO; ++k) {
            row[2 + k] = (double)info[k];
        }
        for (int k = 0; k < n; ++k) {
            row[2 + INFO + k] = (double)tensions[k];
        }
        for (int k = 0; k < 3 * n; ++k) {
            row[2 + INFO + n + k] = (double)directions[k];
        }
        machine_give(row, (int)sizeof(double) * (2 + INFO + 4 * n));
    }
    machine_give(&deepest, (int)sizeof deepest);
    machine_end();
    return 0;
}

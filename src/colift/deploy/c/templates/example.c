// The allocator in a loop: a load that is led along a circle.

#include "colift.h"
#include "colift_team.h"

#include <math.h>
#include <stdio.h>

int main(void)
{
    static @REAL@ memory[COLIFT_ALLOCATION_MEMORY];
    @REAL@ force[3] = {0}, moment[3] = {0}, reference[4 * 3] = {0}, rates[3 * 3] = {0};
    @REAL@ attitude[4] = {1}, wanted_attitude[4] = {1};
    @REAL@ nominal[COLIFT_DRONES * 3 * 3], formation[COLIFT_DRONES * 3] = {0};
    @REAL@ tensions[COLIFT_DRONES] = {0}, directions[COLIFT_DRONES * 3] = {0}, info[7];
    for (int k = 0; k < COLIFT_DRONES * 9; ++k) {
        nominal[k] = (@REAL@)NAN; // nothing is planned
    }
    for (int i = 0; i < COLIFT_DRONES; ++i) { // where the cables point at first: a cone
        const @REAL@ angle = (@REAL@)(6.283185307179586 * i / COLIFT_DRONES);
        directions[3 * i] = (@REAL@)(0.5 * cos(angle));
        directions[3 * i + 1] = (@REAL@)(0.5 * sin(angle));
        directions[3 * i + 2] = (@REAL@)-sqrt(0.75);
    }
    const colift_allocation_sees sees = {
        .n = COLIFT_DRONES, .force = force, .moment = moment, .reference = reference,
        .reference_attitude = wanted_attitude, .reference_rates = rates, .estimated_load_attitude = attitude,
        .nominal_forces = nominal, .formation = formation,
    };
    const colift_allocation_writes writes = {
        .n = COLIFT_DRONES, .desired_tensions = tensions, .desired_directions = directions, .allocator_info = info,
    };
    colift_allocation_start(memory);
    for (int step = 0; step < 500; ++step) {
        const colift_now now = {step, (@REAL@)(0.01 * step), (@REAL@)0.01};
        force[0] = (@REAL@)(0.3 * cos(0.01 * step));
        force[1] = (@REAL@)(0.3 * sin(0.01 * step));
        force[2] = (@REAL@)2.2;
        const int status = @ALLOCATE@(&now, &sees, colift_allocation_params, memory, &writes);
        if (step % 100 == 0) {
            printf("t = %.1f s, status %d, tensions", (double)now.time, status);
            for (int i = 0; i < COLIFT_DRONES; ++i) {
                printf(" %.4f", (double)tensions[i]);
            }
            printf(" N\n");
        }
    }
    return 0;
}

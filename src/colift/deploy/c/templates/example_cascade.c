// The cascade of all drones, which hang still where the mission begins.

#include "colift_cascade.h"

#include <stdio.h>

int main(void)
{
    static colift_cascade c;
    colift_cascade_start(&c);
    for (int step = 0; step < 200; ++step) {
        // here: fill c.estimated_..., c.reference from sensors and mission
        colift_step(&c, step);
    }
    for (int i = 0; i < COLIFT_DRONES; ++i) {
        printf(
            "drone %d: status %d, thrust %.4f N, moment %.5f %.5f %.5f N m\n", i, c.status, (double)c.thrusts[i],
            (double)c.torques[3 * i], (double)c.torques[3 * i + 1], (double)c.torques[3 * i + 2]);
    }
    return 0;
}

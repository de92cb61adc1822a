#include "colift_cascade.h"

#include <math.h>

void colift_cascade_start(colift_cascade *c)
{
    static const colift_cascade nothing;
    *c = nothing;
@START@
}

void colift_step(colift_cascade *c, int step)
{
    const @REAL@ time = (@REAL@)step * COLIFT_STEP;
    for (int i = 0; i < COLIFT_DRONES; ++i) { // all cables end where the load is
        for (int k = 0; k < 2 * 3; ++k) {
            c->estimated_ends[6 * i + k] = c->estimated_load[k];
        }
        for (int k = 0; k < 4 * 3; ++k) {
            c->wanted_ends[12 * i + k] = c->reference[k];
        }
    }
@CALLS@
    for (int i = 0; i < COLIFT_DRONES; ++i) { // heard at once
        c->received_tensions[i] = c->lift_share[0] * c->desired_tensions[i];
        for (int k = 0; k < 3; ++k) {
            c->received_directions[3 * i + k] = c->desired_directions[3 * i + k];
        }
    }
@MORE@
}
